// SPDX-License-Identifier: LGPL-2.1-or-later
/* Loading the module outlet_lsl.so; see incise/outlet.h. It stays loaded. */
#include <incise/outlet.h>
#include "../base/module.h"

#define FILE_NAME "outlet_lsl.so"

/* Exported by it. NULL: liblsl cannot be had. */
typedef int loader(const char *where, const struct incise_outlets **outlets,
		   struct incise_error *err);

int incise_outlets_open(const char *where, const struct incise_outlets **outlets,
			struct incise_error *err)
{
	struct incise_module module;
	loader *load;
	int rc = incise_module_find(&module, FILE_NAME, "incise_outlets_load", where,
				    "a C compiler is", err);

	if (rc)
		return rc;
	/* POSIX has this form for a function's address. */
	*(const void **)&load = module.symbol;
	return load(where, outlets, err);
}
