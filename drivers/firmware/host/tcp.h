/* A TCP connection of this computer's own as the board's UART: one host at a time, and when it is
 * gone the next one. Nothing waits. Unlike a terminal's, its bytes pass through no kernel worker. */
#ifndef HELI3DOF_TCP_H
#define HELI3DOF_TCP_H

#include <stddef.h>
#include <stdint.h>

/* Listens on 127.0.0.1 (port 0: any that is free); the file descriptor, or -1 with errno. `name`
 * gets "socket://127.0.0.1:PORT". */
int tcp_listen(uint16_t port, char *name, size_t room);

/* The host that has come, or -1. */
int tcp_accept(int listener);

/* How many bytes; 0 where there are none. Closes `*fd` and sets it to -1 where the host is gone. */
size_t tcp_read(int *fd, uint8_t *bytes, size_t room);

#endif
