// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Backends by their names, in modules; see backends.h. Only a module that is
 * named is loaded, as it brings its libraries into the process.
 */
#include <dirent.h>
#include <dlfcn.h>
#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include "backends.h"
#include "../base/module.h"

#define BUILT_IN_SIM "sim" /* rig.c opens it, with the simulated world behind it */
#define SYMBOL "incise_backend"

/* Names become parts of paths. */
static bool is_plain_backend(const char *name)
{
	size_t length = strspn(name, "abcdefghijklmnopqrstuvwxyz0123456789_");

	return length && length < 32 && !name[length];
}

/* "sim, gpio, kernel": all backends of a kind. */
static void list_backends(const char *kind, const char *in, char *text, size_t size)
{
	size_t prefix = strlen(kind), length;
	DIR *dir = in ? opendir(in) : NULL;
	struct dirent *entry;

	snprintf(text, size, BUILT_IN_SIM);
	while (dir && (entry = readdir(dir))) {
		const char *name = entry->d_name;
		size_t n = strlen(name);

		if (n < prefix + 5 || strncmp(name, kind, prefix) ||
		    name[prefix] != '_' || strcmp(name + n - 3, ".so"))
			continue;
		length = strlen(text);
		snprintf(text + length, size - length, ", %.*s", (int)(n - prefix - 4),
			 name + prefix + 1);
	}
	if (dir)
		closedir(dir);
}

int incise_backend_names(const char *kind, char names[][32], int capacity)
{
	char known[400], in[PATH_MAX], *rest = known, *name;
	int n = 0;

	list_backends(kind, incise_module_folder(in, sizeof(in)) ? in : NULL, known,
		      sizeof(known));
	while ((name = strsep(&rest, ", ")) && n < capacity)
		if (*name && strcmp(name, BUILT_IN_SIM))
			snprintf(names[n++], sizeof(*names), "%.31s", name);
	return n;
}

static int load_backends(struct incise_loaded *loaded, const char *kind, const char *name,
			 const char *path, const char *where, struct incise_error *err)
{
	const struct incise_backend *backend;
	struct incise_module module;
	int rc = incise_module_open(&module, path, SYMBOL, where, err);

	if (rc)
		return rc;
	backend = module.symbol;
	if (backend->abi != INCISE_BACKEND_ABI)
		rc = incise_error_set(err, ENOEXEC,
				      "%s: %.200s: built for interface %u, this is %u; "
				      "build it again",
				      where, path, backend->abi, INCISE_BACKEND_ABI);
	else if (!backend->open || !backend->kind || strcmp(backend->kind, kind) ||
		 !backend->name || strcmp(backend->name, name))
		rc = incise_error_set(err, ENOEXEC,
				      "%s: %.200s: contains another backend than its "
				      "name says; build it again",
				      where, path);
	if (rc) {
		dlclose(module.handle);
		errno = -rc;
		return rc;
	}
	*loaded = (struct incise_loaded){backend, module.handle};
	return 0;
}

int incise_backend_find(struct incise_loaded *loaded, const char *kind, const char *name,
			const char *where, struct incise_error *err)
{
	char in[PATH_MAX], path[PATH_MAX + 80], known[200];
	bool has_folder = incise_module_folder(in, sizeof(in));
	struct stat status;

	if (has_folder && is_plain_backend(name)) {
		snprintf(path, sizeof(path), "%s/%s_%s.so", in, kind, name);
		if (!stat(path, &status) && S_ISREG(status.st_mode))
			return load_backends(loaded, kind, name, path, where, err);
	}
	list_backends(kind, has_folder ? in : NULL, known, sizeof(known));
	return incise_backend_absent(kind, name, where, known, err);
}

int incise_backend_absent(const char *kind, const char *name, const char *where,
			  const char *known, struct incise_error *err)
{
	char module[80];
	const char *packages;

	snprintf(module, sizeof(module), "%.30s_%.40s", kind, name);
	packages = incise_module_packages(module);
	return incise_error_set(err, ENODEV,
				"%s: no %sbackend \"%.40s\"%s%s%s; there are: %.160s",
				where, packages ? "" : "such ", name,
				packages ? " in this build: apt-get install " : "",
				packages ? packages : "",
				packages ? ", and build incise again" : "", known);
}

void incise_backend_unload(struct incise_loaded *loaded)
{
	if (loaded->handle)
		dlclose(loaded->handle);
	*loaded = (struct incise_loaded){0};
}
