// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * HDF5's module, loaded at first use, so that only who writes HDF5 maps its library; see
 * table_writer.h. It stays loaded: libhdf5 runs at the program's end.
 */
#include <dlfcn.h>
#include <errno.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <incise/backend.h>
#include "table_writer.h"

#define MODULE "export_hdf5.so"
#define SYMBOL "incise_backend"

/* As of the modules of devices: INCISE_MODULE_PATH, or incise/ beside this library. */
static bool find(char *path, size_t size)
{
	const char *given = secure_getenv("INCISE_MODULE_PATH");
	char own[PATH_MAX];
	Dl_info info;
	int length;

	if (given && *given) {
		length = snprintf(path, size, "%s/" MODULE, given);
		return length > 0 && (size_t)length < size;
	}
	if (!dladdr((void *)incise_table_hdf5, &info) || !info.dli_fname ||
	    !realpath(info.dli_fname, own) || !strrchr(own, '/'))
		return false;
	*strrchr(own, '/') = '\0';
	length = snprintf(path, size, "%s/incise/" MODULE, own);
	return length > 0 && (size_t)length < size;
}

const struct incise_table_format *incise_table_hdf5(struct incise_error *err)
{
	const struct incise_table_format *format = NULL;
	const struct incise_backend *backend;
	char path[PATH_MAX];
	void *handle;

	if (!find(path, sizeof(path)) || access(path, R_OK)) {
		incise_error_set(err, ENOENT,
				 "HDF5: there is no module " MODULE
				 "; build and install incise where libhdf5-dev is, or "
				 "set INCISE_MODULE_PATH");
		return NULL;
	}
	handle = dlopen(path, RTLD_NOW | RTLD_LOCAL);
	if (!handle) {
		incise_error_set(err, ENOEXEC,
				 "HDF5: the module cannot be loaded: %.300s; install "
				 "what it needs",
				 dlerror());
		return NULL;
	}
	backend = dlsym(handle, SYMBOL);
	if (backend && backend->abi == INCISE_BACKEND_ABI && backend->open &&
	    !strcmp(backend->kind, "export") && !strcmp(backend->name, "hdf5"))
		format = backend->open(NULL, err);
	if (format && format->abi == INCISE_TABLE_ABI)
		return format;
	dlclose(handle);
	incise_error_set(err, ENOEXEC,
			 "HDF5: %.300s is made for another incise; build it again", path);
	return NULL;
}
