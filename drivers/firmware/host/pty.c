#include "pty.h"

#include <fcntl.h>
#include <stdlib.h>
#include <termios.h>
#include <unistd.h>

int pty_open(char *path, size_t room)
{
    struct termios raw;
    const int fd = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    if (fd < 0 || grantpt(fd) < 0 || unlockpt(fd) < 0 || ptsname_r(fd, path, room) != 0)
        return -1;
    const int far = open(path, O_RDWR | O_NOCTTY | O_CLOEXEC); /* never closed, see pty.h */
    if (far < 0 || tcgetattr(far, &raw) < 0)
        return -1;
    cfmakeraw(&raw);
    return tcsetattr(far, TCSANOW, &raw) < 0 ? -1 : fd;
}

size_t pty_read(int fd, uint8_t *bytes, size_t room)
{
    const ssize_t n = read(fd, bytes, room);
    return n > 0 ? (size_t)n : 0;
}

size_t pty_write(int fd, const uint8_t *bytes, size_t n)
{
    const ssize_t written = write(fd, bytes, n);
    return written > 0 ? (size_t)written : 0;
}
