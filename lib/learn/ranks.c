// SPDX-License-Identifier: LGPL-2.1-or-later
/* Loading the module ranks_mpi.so; see incise/ranks.h. It stays loaded. */
#include <errno.h>
#include <incise/ranks.h>
#include "../base/module.h"

#define FILE_NAME "ranks_mpi.so"

/* Exported by it: joins the job. NULL: that failed. */
typedef const struct incise_ranks *joiner(void);

int incise_ranks_open(const struct incise_ranks **ranks, struct incise_error *err)
{
	struct incise_module module;
	joiner *join;
	int rc = incise_module_find(&module, FILE_NAME, "incise_ranks_join",
				    "--share mpi", err);

	if (rc)
		return rc;
	/* POSIX has this form for a function's address. */
	*(const void **)&join = module.symbol;
	*ranks = join();
	return *ranks ? 0
		      : incise_error_set(
				err, EIO,
				"--share mpi: MPI does not start; run 'mpirun -n N incise "
				"train --share mpi …'");
}
