/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The backends that rig.conf can name: those built in, and modules that are loaded for it.
 *
 *   "kernel:/dev/…"     built in
 *   "gpio:…"            DIR/stepper_gpio.so, DIR: INCISE_MODULE_PATH, or the folder incise/
 *                       beside libincise.so
 */
#ifndef INCISE_BACKENDS_H
#define INCISE_BACKENDS_H

#include <incise/backend.h>

extern const struct incise_backend incise_stepper_kernel;

/* A backend and the module that it came from. */
struct incise_loaded {
	const struct incise_backend *backend;
	void *handle; /* of dlopen(); NULL: built in */
};

/*
 * Find a backend, and load its module if it is in one. @where begins the message.
 * Returns 0; -ENODEV (there is none: the message lists those there are), -ENOEXEC (its
 * module is broken, or made for another version).
 */
int incise_backend_find(struct incise_loaded *loaded, const char *kind, const char *name,
			const char *where, struct incise_error *err);

/* Those that there are of a kind, built in and in modules; "sim" not. Ends with n names. */
int incise_backend_names(const char *kind, char names[][32], int room);

void incise_backend_unload(struct incise_loaded *loaded);

#endif
