// SPDX-License-Identifier: LGPL-2.1-or-later
/* A texture and its file; see incise/texture.h and incise-tex(5). */
#include <errno.h>
#include <inttypes.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/outfile.h>
#include "../base/c_locale.h"
#include "companion.h"
#include "texture.h"

#define VERSION 1
#define KIND "incise-tex"

#define fail incise_lines_error

/* Lines of numbers, in their order, each within its range. */
#define FIELD(key, member, n, least, most)                                   \
	{                                                                    \
		key, offsetof(struct incise_texture, member), n, least, most \
	}
#define LOOK(key, of, least_rate)                                             \
	FIELD(key "-rate", of.rate, 1, least_rate, 1e9),                      \
		FIELD(key "-rms", of.rms, 1, 0, 1e9),                         \
		FIELD(key "-drops", of.drop, INCISE_TEXTURE_DECILES, 0, 1e9), \
		FIELD(key "-octaves", of.octave, INCISE_TEXTURE_OCTAVES, -1e3, 1e3)

static const struct {
	const char *key;
	size_t at; /* in the texture */
	int n;
	double least, most;
} fields[] = {
	FIELD("most", info.most, 1, 0, (double)INCISE_TEXTURE_MOST / INCISE_TEXTURE_ONE),
	FIELD("variation", info.variation, 1, 0, 1),
	FIELD("cycles", info.up_to_cycles, 1, 1e-9, 1e9),
	FIELD("length", info.length, 1, 0, 1e12),
	FIELD("error", info.error, 2, 0, 1e3),
	LOOK("recorded", info.recorded, 1e-9),
	LOOK("rendered", info.rendered, 0),
	FIELD("step", step, 1, 1. / 256, 16),
};

#define FIELDS (sizeof(fields) / sizeof(*fields))

static int read_fields(struct incise_lines *in, struct incise_texture *texture)
{
	for (size_t i = 0; i < FIELDS; i++) {
		double *to = (double *)((char *)texture + fields[i].at);
		int rc = incise_companion_numbers(in, fields[i].key, to, fields[i].n);

		for (int k = 0; k < fields[i].n && !rc; k++)
			if (to[k] < fields[i].least || to[k] > fields[i].most)
				rc = fail(in, EINVAL, "%s: expected %g to %g, found %g",
					  fields[i].key, fields[i].least, fields[i].most,
					  to[k]);
		if (rc)
			return rc;
	}
	return 0;
}

/* The line "KEY N" into an int. */
static int read_count(struct incise_lines *in, const char *key, long least, long most,
		      int *to)
{
	long value = 0;
	int rc = incise_companion_whole(in, key, least, most, &value);

	*to = (int)value;
	return rc;
}

static int read_curves(struct incise_lines *in, struct incise_texture *texture)
{
	double most = texture->info.most * INCISE_TEXTURE_ONE, *point = texture->point;
	int left = INCISE_TEXTURE_POINTS, rc = 0;

	for (int i = 0; i < texture->n_curves && !rc; i++) {
		int n, longest =
			       left < INCISE_TEXTURE_PIECE ? left : INCISE_TEXTURE_PIECE;

		rc = read_count(in, "curve", 2, longest, &n);
		if (!rc)
			rc = incise_companion_row(in, point, n);
		if (rc)
			return rc;
		for (int k = 0; k < n && !rc; k++)
			if (fabs(point[k]) > most || point[k] != rint(point[k]))
				rc = fail(in, EINVAL,
					  "%g is not a whole number up to the most, %g",
					  point[k], most);
		texture->n[i] = n;
		point += n;
		left -= n;
	}
	return rc ? rc : incise_companion_end(in);
}

static int read_texture_file(struct incise_lines *in, struct incise_texture *texture)
{
	struct incise_texture_info *info = &texture->info;
	int rc = incise_companion_head(in, KIND, VERSION, &texture->checksum);
	char *unit = rc ? NULL : incise_companion_value(in, "way");
	long seed = 0;

	if (!unit)
		return rc ? rc : -errno;
	if (strlen(unit) >= sizeof(info->unit) ||
	    unit[strspn(unit, "abcdefghijklmnopqrstuvwxyz")])
		return fail(in, EINVAL, "way: '%.20s' is not a unit", unit);
	strcpy(info->unit, unit);
	rc = incise_companion_whole(in, "seed", 0, LONG_MAX, &seed);
	info->seed = (uint64_t)seed;
	if (!rc)
		rc = read_count(in, "cuts", 1, INT_MAX, &info->n_cuts);
	if (!rc)
		rc = read_count(in, "events", 0, INT_MAX, &info->n_events);
	if (!rc)
		rc = read_fields(in, texture);
	if (!rc)
		rc = read_count(in, "curves", 1, INCISE_TEXTURE_CURVES,
				&texture->n_curves);
	return rc ? rc : read_curves(in, texture);
}

struct incise_texture *incise_texture_load(const char *path,
					   const struct incise_model *model,
					   struct incise_error *err)
{
	static const struct incise_infile_kind tex = {
		.name = "a .tex file",
		.advice = "'incise train --texture' writes it next to a model",
		.size_max = 16 << 20,
	};
	struct incise_texture *texture = calloc(1, sizeof(*texture));
	struct incise_lines in;
	int rc;

	if (!texture)
		return INCISE_ERROR_NULL(err, ENOMEM, "%s: no memory to read it", path);
	texture->checksum = model ? incise_model_checksum(model) : 0;
	rc = incise_lines_open(&in, path, &tex, err);
	if (!rc) {
		rc = read_texture_file(&in, texture);
		incise_lines_close(&in);
	}
	if (!rc)
		return texture;
	incise_texture_free(texture);
	errno = -rc;
	return NULL;
}

int incise_texture_save(const struct incise_texture *texture, const char *path,
			struct incise_error *err)
{
	const struct incise_texture_info *info = &texture->info;
	struct incise_outfile *file = incise_outfile_open(path, err);
	const double *point = texture->point;
	struct incise_c_locale locale;
	FILE *out;

	if (!file)
		return -errno;
	locale = incise_c_locale_begin();
	out = incise_outfile_stream(file);
	fprintf(out,
		KIND " %d\nmodel %016" PRIx64 "\nway %s\nseed %" PRIu64
		     "\ncuts %d\nevents %d\n",
		VERSION, texture->checksum, info->unit, info->seed, info->n_cuts,
		info->n_events);
	for (size_t i = 0; i < FIELDS; i++) {
		const double *from =
			(const double *)((const char *)texture + fields[i].at);

		fprintf(out, "%s ", fields[i].key);
		incise_companion_write_row(out, from, fields[i].n);
	}
	fprintf(out, "curves %d\n", texture->n_curves);
	for (int i = 0; i < texture->n_curves; point += texture->n[i++]) {
		fprintf(out, "curve %d\n", texture->n[i]);
		incise_companion_write_row(out, point, texture->n[i]);
	}
	incise_c_locale_end(locale);
	return incise_outfile_commit(file, err);
}

void incise_texture_free(struct incise_texture *texture)
{
	free(texture);
}

const struct incise_texture_info *incise_texture_info(
	const struct incise_texture *texture)
{
	return &texture->info;
}

double incise_texture_tape(const struct incise_texture *texture, uint64_t seed,
			   double tau[INCISE_TEXTURE_TAPE])
{
	struct incise_fixed_texture tape;

	_Static_assert(INCISE_TEXTURE_TAPE == INCISE_TEXTURE_KNOTS, "a point is a knot");
	incise_texture_fill(texture, 0, seed, &tape);
	for (int i = 0; i < INCISE_TEXTURE_TAPE; i++)
		tau[i] = (double)tape.knot[i] / INCISE_TEXTURE_ONE;
	return ldexp(1, tape.step_shift - 16);
}
