// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * HDF5's module, loaded at first use, so that only who writes HDF5 maps its library; see
 * table_writer.h. It stays loaded: libhdf5 runs at the program's end.
 */
#include <errno.h>
#include <string.h>
#include <incise/backend.h>
#include "../../device/module.h"
#include "table_writer.h"

#define MODULE "export_hdf5.so"

const struct incise_table_format *incise_table_hdf5(struct incise_error *err)
{
	const struct incise_table_format *format = NULL;
	const struct incise_backend *backend;
	struct incise_module module;

	if (incise_module_find(&module, MODULE, "incise_backend", "HDF5",
			       "libhdf5-dev is", err))
		return NULL;
	backend = module.symbol;
	if (backend->abi == INCISE_BACKEND_ABI && backend->open &&
	    !strcmp(backend->kind, "export") && !strcmp(backend->name, "hdf5"))
		format = backend->open(NULL, err);
	if (format && format->abi == INCISE_TABLE_ABI)
		return format;
	errno = -incise_module_refuse(&module, MODULE, "HDF5", err);
	return NULL;
}
