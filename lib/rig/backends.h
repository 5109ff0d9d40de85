/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The backends that rig.conf can name, each in a module that is loaded when it is named.
 *
 *   "gpio:…"            DIR/stepper_gpio.so, DIR: INCISE_MODULE_PATH, or the folder incise/
 *                       next to libincise.so
 */
#ifndef INCISE_BACKENDS_H
#define INCISE_BACKENDS_H

#include <incise/backend.h>

/*
 * INCISE_BACKEND(incise_stepper_mine, "stepper", "mine", .open = f): a backend, which its module
 * exports as `incise_backend`; weak, as tests may link several, by their own names.
 */
#define INCISE_BACKEND(backend, kind_, name_, ...)                                     \
	const struct incise_backend backend = {                                        \
		.abi = INCISE_BACKEND_ABI, .kind = kind_, .name = name_, __VA_ARGS__}; \
	INCISE_MODULE(backend)
#define INCISE_MODULE(backend)                                       \
	INCISE_API extern const struct incise_backend incise_backend \
		__attribute__((weak, alias(#backend)))

/* A device of zeros, which has its own cache lines; free(3) frees it. NULL with errno and a message. */
void *incise_device_new(size_t size, const char *where, struct incise_error *err);

/* A backend and the module that it came from. */
struct incise_loaded {
	const struct incise_backend *backend;
	void *handle; /* of dlopen() */
};

/*
 * Find a backend and load its module. @where starts the message. 0;
 * -ENODEV (the message lists the known ones); -ENOEXEC (its module is broken, or of
 * another version).
 */
int incise_backend_find(struct incise_loaded *loaded, const char *kind, const char *name,
			const char *where, struct incise_error *err);

/* -ENODEV: the message lists the @known ones, and the packages by which this one of its @kind is built. */
int incise_backend_absent(const char *kind, const char *name, const char *where,
			  const char *known, struct incise_error *err);

/* All backends of a kind, without "sim"; how many. */
int incise_backend_names(const char *kind, char names[][32], int capacity);

void incise_backend_unload(struct incise_loaded *loaded);

#endif
