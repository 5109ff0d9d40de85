/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The emulator behind a pseudo terminal, in a thread, in real time. Under a name of its own,
 * so that it can be pulled out and come back as another one.
 */
#ifndef INCISE_TEST_POLHEMUS_PTY_H
#define INCISE_TEST_POLHEMUS_PTY_H

#include <fcntl.h>
#include <poll.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "../../clock.h"
#include "../../polhemus/emulator.h"

struct pty {
	struct emulator emulator;
	char folder[32], path[48]; /* a link */
	int master;
	pthread_t thread;
	_Atomic bool stop;
	_Atomic uint64_t slots;
	_Atomic bool deaf;	      /* sends nothing either */
	const char *_Atomic injected; /* bytes that reach it without the host; once */
};

static void *pty_run(void *argument)
{
	struct pty *p = argument;

	while (!atomic_load(&p->stop)) {
		struct pollfd waits = {.fd = p->master, .events = POLLIN};
		const char *injected;
		char bytes[1024];
		ssize_t n;
		size_t m;

		poll(&waits, 1, 1);
		n = waits.revents & POLLIN ? read(p->master, bytes, sizeof(bytes)) : 0;
		emulator_advance(&p->emulator, now_ns());
		injected = atomic_exchange(&p->injected, NULL);
		if (injected)
			emulator_write(&p->emulator, injected, strlen(injected));
		if (n > 0 && !atomic_load(&p->deaf))
			emulator_write(&p->emulator, bytes, (size_t)n);
		while ((m = emulator_take(&p->emulator, bytes, sizeof(bytes))) > 0)
			if (!atomic_load(&p->deaf) &&
			    write(p->master, bytes, m) != (ssize_t)m)
				break; /* as a line that nobody reads */
		atomic_store(&p->slots, p->emulator.slot);
	}
	return NULL;
}

static inline int pty_plug(struct pty *p)
{
	char name[64];

	p->master = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
	if (p->master < 0 || grantpt(p->master) || unlockpt(p->master) ||
	    ptsname_r(p->master, name, sizeof(name)) || symlink(name, p->path))
		return -1;
	atomic_store(&p->stop, false);
	return pthread_create(&p->thread, NULL, pty_run, p);
}

static inline void pty_unplug(struct pty *p)
{
	atomic_store(&p->stop, true);
	pthread_join(p->thread, NULL);
	unlink(p->path);
	close(p->master);
}

static inline int pty_begin(struct pty *p, enum emulator_kind kind)
{
	memset(p, 0, sizeof(*p));
	strcpy(p->folder, "/tmp/incise-pty-XXXXXX");
	if (!mkdtemp(p->folder))
		return -1;
	snprintf(p->path, sizeof(p->path), "%s/tty", p->folder);
	emulator_init(&p->emulator, kind, now_ns());
	return pty_plug(p);
}

static inline void pty_end(struct pty *p)
{
	rmdir(p->folder);
	emulator_free(&p->emulator);
}

#endif
