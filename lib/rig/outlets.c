// SPDX-License-Identifier: LGPL-2.1-or-later
/* Loading a module of outlets; see incise/outlet.h. It stays loaded. */
#include <incise/outlet.h>
#include "../base/module.h"

/* Exported by it. NULL: its library cannot be had. */
typedef int loader(const char *where, const struct incise_outlets **outlets,
		   struct incise_error *err);

int incise_outlets_open(const char *where, enum incise_outlet_protocol protocol,
			const struct incise_outlets **outlets, struct incise_error *err)
{
	static const char *const modules[] = {
		[INCISE_OUTLET_LSL] = "outlet_lsl.so",
		[INCISE_OUTLET_ROS2] = "outlet_ros2.so",
	};
	struct incise_module module;
	loader *load;
	int rc = incise_module_find(&module, modules[protocol], "incise_outlets_load",
				    where, err);

	if (rc)
		return rc;
	/* POSIX has this form for a function's address. */
	*(const void **)&load = module.symbol;
	return load(where, outlets, err);
}
