/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Modules: shared objects that bring a library into the process, loaded at first use.
 *
 *     INCISE_MODULE_PATH, or the folder incise/ next to the library that loads it
 *       ├── stepper_gpio.so, vision_opencv.so …   `incise_backend`
 *       ├── export_hdf5.so                        `incise_table_hdf5`
 *       └── frames_mkv.so                         `incise_frames`
 *
 * libincise, libincise-record and libincise-view each contain this.
 */
#ifndef INCISE_MODULE_H
#define INCISE_MODULE_H

#include <incise/backend.h>
#include <incise/error.h>

struct incise_module {
	void *handle;	    /* of dlopen() */
	const void *symbol; /* exported by it */
};

/*
 * Load a file and find its symbol. @where starts the message. 0 or -ENOEXEC (it is
 * broken, or no module).
 */
int incise_module_open(struct incise_module *module, const char *path, const char *symbol,
		       const char *where, struct incise_error *err);

/* The same for a file of the folder; -ENOENT: see below. */
int incise_module_find(struct incise_module *module, const char *file, const char *symbol,
		       const char *where, struct incise_error *err);

/* -ENOENT, with the packages that its build needs. */
int incise_module_absent(const char *file, const char *where, struct incise_error *err);

/*
 * The packages by which a module "KIND_NAME" is built, "libx-dev liby-dev". NULL: it needs none, or there is no
 * such module.
 */
const char *incise_module_packages(const char *module);

/*
 * Its symbol, a struct that begins with the version of its interface, for good. NULL with errno of
 * incise_module_find(), and ENOEXEC for another version.
 */
const void *incise_module_load(const char *file, const char *symbol, unsigned int abi,
			       const char *where, struct incise_error *err);

#endif
