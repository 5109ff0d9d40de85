// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Opening liblsl; see liblsl.h.
 */
#include <dlfcn.h>
#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>
#include "liblsl.h"

#define LIBRARY_VARIABLE "PYLSL_LIB" /* of pylsl and its users */
#define CONFIG_VARIABLE "LSLAPICFG"
/* Its fatal errors only: that a stream broke off is reported by the reader, in its own words. */
#define QUIET "[log]\nlevel = -3\n"

/* Whether liblsl finds a configuration of the user, in the places that it reads. */
static bool is_configured(void)
{
	const char *home = getenv("HOME");
	char path[PATH_MAX];

	snprintf(path, sizeof(path), "%.4000s/lsl_api/lsl_api.cfg", home ? home : "");
	return getenv(CONFIG_VARIABLE) || !access("lsl_api.cfg", R_OK) ||
	       !access(path, R_OK) || !access("/etc/lsl_api/lsl_api.cfg", R_OK);
}

/* It prints lines of its start otherwise. Versions before 1.17 cannot be asked. */
static void be_quiet(void *handle)
{
	void (*set_content)(const char *);

	*(void **)&set_content = dlsym(handle, "lsl_set_config_content");
	if (set_content && !is_configured())
		set_content(QUIET);
}

static int load_liblsl(struct liblsl *lsl, const char *where, struct incise_error *err)
{
	const char *missing = NULL;

#define LIBLSL_LOAD(name, type, arguments)                \
	*(void **)&lsl->name = dlsym(lsl->handle, #name); \
	if (!lsl->name)                                   \
		missing = #name;
	LIBLSL_FUNCTIONS(LIBLSL_LOAD)
#undef LIBLSL_LOAD
	if (!missing) {
		be_quiet(lsl->handle);
		return 0;
	}
	return incise_error_set(
		err, ENOEXEC,
		"%s: this liblsl has no function %s; install version 1.13 or "
		"later, and name it in " LIBRARY_VARIABLE,
		where, missing);
}

int liblsl_open(struct liblsl *lsl, const char *where, struct incise_error *err)
{
	const char *named = secure_getenv(LIBRARY_VARIABLE);
	const char *const names[] = {"liblsl.so.2", "liblsl.so"};

	if (named && !*named)
		named = NULL;
	*lsl = (struct liblsl){0};
	for (size_t i = 0; i < sizeof(names) / sizeof(*names) && !lsl->handle; i++)
		lsl->handle = dlopen(named ? named : names[i],
				     RTLD_NOW | RTLD_LOCAL | RTLD_NODELETE);
	if (lsl->handle)
		return load_liblsl(lsl, where, err);
	if (named)
		return incise_error_set(
			err, ENOENT,
			"%s: %.200s of " LIBRARY_VARIABLE
			" cannot be loaded as liblsl; correct that variable",
			where, named);
	return incise_error_set(
		err, ENOENT,
		"%s: liblsl is not installed; install its package from its "
		"makers (or pylsl, which contains it), and set " LIBRARY_VARIABLE
		"=…/liblsl.so",
		where);
}
