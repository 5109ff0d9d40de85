/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * What a service tells its manager: the protocol of sd_notify(3), a datagram of lines
 * VARIABLE=VALUE to the socket in $NOTIFY_SOCKET. It is spoken here as it is a few lines, and
 * libsystemd would bring a megabyte of libraries into a process that is locked in memory.
 */
#ifndef INCISE_NOTIFY_H
#define INCISE_NOTIFY_H

#include <stdint.h>
#include <incise/export.h>

/* Send lines such as "READY=1\nSTATUS=runs". What cannot be sent is lost, and never waits. */
void notify_send(const char *fmt, ...) INCISE_PRINTF(1, 2);

/* "RELOADING=1", with the time that the protocol wants. */
void notify_reloading(void);

/* How often it expects WATCHDOG=1 of this process at the latest; 0: it does not. */
int64_t notify_watchdog_ns(void);

#endif
