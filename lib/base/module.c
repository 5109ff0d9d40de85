// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Loading a module; see module.h.
 */
#include <dlfcn.h>
#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "module.h"

bool incise_module_folder(char *path, size_t size)
{
	const char *given = secure_getenv("INCISE_MODULE_PATH");
	char own[PATH_MAX];
	Dl_info info;
	int length;

	if (given && *given) {
		length = snprintf(path, size, "%s", given);
		return length > 0 && (size_t)length < size;
	}
	if (!dladdr((void *)incise_module_folder, &info) || !info.dli_fname ||
	    !realpath(info.dli_fname, own) || !strrchr(own, '/'))
		return false;
	*strrchr(own, '/') = '\0';
	length = snprintf(path, size, "%s/incise", own);
	return length > 0 && (size_t)length < size;
}

int incise_module_open(struct incise_module *module, const char *path, const char *symbol,
		       const char *where, struct incise_error *err)
{
	module->handle = dlopen(path, RTLD_NOW | RTLD_LOCAL);
	if (!module->handle) {
		char what[200];

		snprintf(what, sizeof(what), "%.150s: the module cannot be loaded",
			 where);
		return incise_error_library(err, what, dlerror());
	}
	module->symbol = dlsym(module->handle, symbol);
	if (module->symbol)
		return 0;
	dlclose(module->handle);
	return incise_error_set(err, ENOEXEC,
				"%s: %.200s: has no symbol %s, so it is not a module "
				"of incise; name another",
				where, path, symbol);
}

int incise_module_find(struct incise_module *module, const char *file, const char *symbol,
		       const char *where, struct incise_error *err)
{
	char in[PATH_MAX], path[PATH_MAX + 80];

	if (incise_module_folder(in, sizeof(in))) {
		snprintf(path, sizeof(path), "%s/%s", in, file);
		if (!access(path, R_OK))
			return incise_module_open(module, path, symbol, where, err);
	}
	return incise_module_absent(file, where, err);
}

const char *incise_module_packages(const char *module)
{
	static const char *const features[][2] = {
#define FEATURE(names, apt, pip) {names, apt},
#include "features.def"
	};
	const size_t length = strlen(module);

	for (size_t i = 0; i < sizeof(features) / sizeof(*features); i++)
		for (const char *at = features[i][0]; (at = strstr(at, module)); at++)
			if ((at == features[i][0] || at[-1] == ' ') &&
			    (!at[length] || at[length] == ' '))
				return features[i][1];
	return NULL;
}

int incise_module_absent(const char *file, const char *where, struct incise_error *err)
{
	char in[PATH_MAX], module[40];
	const char *packages;

	snprintf(module, sizeof(module), "%.*s", (int)strcspn(file, "."), file);
	packages = incise_module_packages(module);
	return incise_error_set(
		err, ENOENT,
		"%s: no module %s in %.300s; %s%s%sbuild incise again, or "
		"set INCISE_MODULE_PATH",
		where, file, incise_module_folder(in, sizeof(in)) ? in : "any folder",
		packages ? "apt-get install " : "", packages ? packages : "",
		packages ? " and " : "");
}

const void *incise_module_load(const char *file, const char *symbol, unsigned int abi,
			       const char *where, struct incise_error *err)
{
	struct incise_module module;

	if (incise_module_find(&module, file, symbol, where, err))
		return NULL;
	if (*(const unsigned int *)module.symbol == abi)
		return module.symbol;
	dlclose(module.handle);
	return INCISE_ERROR_NULL(err, ENOEXEC,
				 "%s: %s was built for another version of incise; build "
				 "it again",
				 where, file);
}
