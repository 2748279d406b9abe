/* A local TCP connection as the board's UART, for one host at a time. Nothing waits. Unlike a
 * terminal's, its bytes pass through no kernel worker. */
#ifndef HELI3DOF_TCP_H
#define HELI3DOF_TCP_H

#include <stddef.h>
#include <stdint.h>

/* Listens on 127.0.0.1 (port 0: any free one); returns the file descriptor, or -1 with errno.
 * Writes "socket://127.0.0.1:PORT" to `name`. */
int tcp_listen(uint16_t port, char *name, size_t room);

/* Returns the file descriptor of a new host's connection, or -1. */
int tcp_accept(int listener);

/* Returns the number of bytes read. Closes `*fd` and sets it to -1 for a host that left. */
size_t tcp_read(int *fd, uint8_t *bytes, size_t room);

#endif
