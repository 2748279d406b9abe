/* A pseudo-terminal as the board's UART, raw. Its far end stays open, so that a host may close and
 * open it again. Neither direction waits. */
#ifndef HELI3DOF_PTY_H
#define HELI3DOF_PTY_H

#include <stddef.h>
#include <stdint.h>

/* Opens a PTY; returns the file descriptor of the board's end, or -1 with errno. Writes the path of
 * the host's end to `path`, which has `room` bytes. */
int pty_open(char *path, size_t room);

/* Both return the number of bytes; 0 where there are none, or no room. */
size_t pty_read(int fd, uint8_t *bytes, size_t room);
size_t pty_write(int fd, const uint8_t *bytes, size_t n);

#endif
