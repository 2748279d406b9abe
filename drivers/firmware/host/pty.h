/* A pseudo-terminal as the board's UART, raw. Its far end stays open, so that a host may close and
 * open it again. Neither direction waits. */
#ifndef HELI3DOF_PTY_H
#define HELI3DOF_PTY_H

#include <stddef.h>
#include <stdint.h>

/* Opens it; the file descriptor of the board's end, or -1 with errno. `path` gets the host's end. */
int pty_open(char *path, size_t room);

/* The number of bytes; 0 where there are none, or no room. */
size_t pty_read(int fd, uint8_t *bytes, size_t room);
size_t pty_write(int fd, const uint8_t *bytes, size_t n);

#endif
