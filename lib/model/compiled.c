// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A compiled model: to and from files, copied, and asked in double; see incise/fixed.h.
 *
 * A part of one noun: tests/unit/model/compile.c tests it through its door.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/outfile.h>
#include "compiled.h"

struct incise_fixed *incise_fixed_load(const char *path, struct incise_error *err)
{
	FILE *file = strcmp(path, "-") ? fopen(path, "re") : stdin;
	struct incise_compiled *owned = NULL;
	size_t size = 0;
	int rc = -ENOMEM;

	if (!file) {
		incise_error_set(err, errno, "%s: %s; give a .fx file of incise compile",
				 path, strerror(errno));
		return NULL;
	}
	/* One byte more than the largest: then it is too large. */
	owned = malloc(sizeof(*owned) + INCISE_FIXED_SIZE_MAX + 8);
	if (owned) {
		size = fread(owned->blob, 1, INCISE_FIXED_SIZE_MAX + 1, file);
		rc = ferror(file)
			     ? -errno
			     : incise_fixed_open(&owned->fx, owned->blob, (uint32_t)size);
	}
	if (file != stdin)
		fclose(file);
	if (rc) {
		free(owned);
		incise_error_set(
			err, -rc,
			rc == -EINVAL ? "%s: not a .fx file, or a damaged one; "
					"compile the model again"
			: rc == -ENOTSUP
				? "%s: a .fx file of another version; compile "
				  "the model again"
				: "%s: cannot be read; give a .fx file of incise "
				  "compile",
			path);
		return NULL;
	}
	return &owned->fx;
}

int incise_fixed_save(const struct incise_fixed *fx, const char *path,
		      struct incise_error *err)
{
	struct incise_outfile *file = incise_outfile_open(path, err);

	if (!file)
		return -errno;
	fwrite(fx->blob, 1, fx->size, incise_outfile_stream(file));
	return incise_outfile_commit(file, err);
}

struct incise_fixed *incise_fixed_copy(const struct incise_fixed *fx)
{
	struct incise_compiled *owned = malloc(sizeof(*owned) + fx->size);

	if (!owned)
		return NULL;
	memcpy(owned->blob, fx->blob, fx->size);
	/* It was valid: it is again. */
	incise_fixed_open(&owned->fx, owned->blob, fx->size);
	return &owned->fx;
}

void incise_fixed_free(struct incise_fixed *fx)
{
	/* fx is the first member of struct incise_compiled. */
	free(fx);
}

double incise_fixed_bound(const struct incise_fixed *fx)
{
	return ldexp((double)fx->bound, -32);
}

double incise_fixed_eval_double(const struct incise_fixed *fx, const double *x)
{
	int32_t in[INCISE_FIXED_INPUTS_MAX];

	for (int i = 0; i < fx->n_inputs; i++) {
		double min = fx->input[i].min, max = fx->input[i].max;

		if (isnan(x[i]))
			in[i] = (int32_t)(min + (max - min) / 2);
		else
			in[i] = (int32_t)lrint(
				fmax(min, fmin(max, x[i] * INCISE_FIXED_ONE)));
	}
	return incise_fixed_eval(fx, in) / (double)INCISE_FIXED_ONE;
}
