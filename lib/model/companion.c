// SPDX-License-Identifier: LGPL-2.1-or-later
/* Files beside a model; see companion.h. */
#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "companion.h"
#include "model.h"

#define fail incise_lines_error

static void add_number(uint64_t *hash, double value)
{
	unsigned char bytes[sizeof(value)];

	memcpy(bytes, &value, sizeof(value));
	for (size_t i = 0; i < sizeof(value); i++) {
#if __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__
		*hash ^= bytes[sizeof(value) - 1 - i];
#else
		*hash ^= bytes[i];
#endif
		*hash *= 0x100000001b3;
	}
}

uint64_t incise_model_checksum(const struct incise_model *model)
{
	int d = model->info.n_inputs, n_rules = model->info.n_rules;
	uint64_t hash = 0xcbf29ce484222325;

	add_number(&hash, d);
	for (int i = 0; i < d; i++) {
		const struct incise_variable *v = &model->info.input[i];

		add_number(&hash, v->min);
		add_number(&hash, v->max);
		for (int k = 0; k < model->info.n_mfs[i]; k++) {
			const struct incise_mf *mf = incise_model_mf(model, i, k);

			for (const char *c = incise_mf_type_name(mf->type); *c; c++)
				add_number(&hash, *c);
			for (int j = 0; j < incise_mf_n_params(mf->type); j++)
				add_number(&hash, mf->p[j]);
		}
	}
	for (int r = 0; r < n_rules; r++) {
		add_number(&hash, model->rule[r].weight);
		for (int i = 0; i < d; i++)
			add_number(&hash, incise_model_rule(model, r)->mf[i]);
		for (int i = 0; i <= d; i++)
			add_number(&hash, incise_model_rule(model, r)->p[i]);
	}
	return hash;
}

/* Next line that is not empty or a comment: 1, or 0 at the end. */
static int next_companion_line(struct incise_lines *in)
{
	int rc;

	do
		rc = incise_lines_next(in, " \t\r\n");
	while (rc > 0 && (!*in->text || *in->text == '#'));
	return rc;
}

char *incise_companion_value(struct incise_lines *in, const char *key)
{
	size_t length = strlen(key);
	int rc = next_companion_line(in);

	if (rc < 0)
		return NULL;
	if (!rc || strncmp(in->text, key, length) || in->text[length] != ' ') {
		fail(in, EINVAL, "expected '%s', found '%.40s': not %s", key,
		     rc ? in->text : "the end", in->kind);
		return NULL;
	}
	return in->text + length + 1;
}

int incise_companion_whole(struct incise_lines *in, const char *key, long least,
			   long most, long *value)
{
	char *text = incise_companion_value(in, key), *end;

	if (!text)
		return -errno;
	errno = 0;
	*value = strtol(text, &end, 10);
	if (end == text || *end || errno)
		return fail(in, EINVAL, "%s: '%.40s' is not a whole number", key, text);
	if (*value < least || *value > most)
		return fail(in, EINVAL, "%s: expected %ld to %ld, found %ld", key, least,
			    most, *value);
	return 0;
}

/* So many finite numbers, from @at on, behind one space for all but the first. */
static int read_numbers(struct incise_lines *in, char *at, double *to, int n)
{
	char *end;

	for (int k = 0; k < n; k++, at = end) {
		to[k] = incise_decimal(at, &end);
		if (end == at || (*end && *end != ' '))
			return fail(in, EINVAL, "'%.30s' is not a number", at);
		if (!isfinite(to[k]))
			return fail(in, EINVAL, "'%.*s' is not finite", (int)(end - at),
				    at);
	}
	return *at ? fail(in, EINVAL, "expected no more than %d number%s", n,
			  n == 1 ? "" : "s")
		   : 0;
}

int incise_companion_numbers(struct incise_lines *in, const char *key, double *to, int n)
{
	char *at = incise_companion_value(in, key);

	return at ? read_numbers(in, at, to, n) : -errno;
}

int incise_companion_row(struct incise_lines *in, double *to, int n)
{
	int rc = next_companion_line(in);

	if (!rc)
		return fail(in, EINVAL,
			    "the file ends before its last row: it is truncated; train "
			    "again");
	return rc < 0 ? rc : read_numbers(in, in->text, to, n);
}

int incise_companion_head(struct incise_lines *in, const char *kind, int version,
			  uint64_t *checksum)
{
	char *text, *end;
	uint64_t sum;
	long found;
	int rc = incise_companion_whole(in, kind, LONG_MIN, LONG_MAX, &found);

	if (rc)
		return rc;
	if (found != version)
		return fail(in, EINVAL,
			    "version %ld: this incise reads version %d; train again",
			    found, version);
	text = incise_companion_value(in, "model");
	if (!text)
		return -errno;
	sum = strtoull(text, &end, 16);
	if (strspn(text, "0123456789abcdef") != 16 || *end)
		return fail(in, EINVAL, "model: '%.40s' is not a checksum of 16 digits",
			    text);
	if (*checksum && sum != *checksum)
		return fail(in, ESTALE,
			    "stale: made for other parameters of the model; train "
			    "again, or remove it");
	*checksum = sum;
	return 0;
}

int incise_companion_end(struct incise_lines *in)
{
	int rc = next_companion_line(in);

	return rc > 0 ? fail(in, EINVAL, "'%.20s' after the last row", in->text) : rc;
}

void incise_companion_write_row(FILE *out, const double *row, int n)
{
	for (int k = 0; k < n; k++)
		fprintf(out, "%.17g%c", row[k], k + 1 < n ? ' ' : '\n');
}
