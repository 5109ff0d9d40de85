// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Factors; see incise/factor.h. The file and its text are those of incise-fac(5): lines of text,
 * exact sums, and a CRC-32C of all before it.
 */
#include <endian.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <incise/infile.h>
#include <incise/outfile.h>
#include <incise/version.h>
#include "../base/c_locale.h"
#include "../base/crc32c.h"
#include "../base/crypto/sha256.h"
#include "../base/grow.h"
#include "../base/random.h"
#include "design.h"
#include "factor.h"
#include "crossval.h"
#include "interval.h"

#define FORM 3 /* of the file */
#define FOLDS INCISE_FACTOR_FOLDS
#define SOURCES_MAX 1000000

/*
 * A group is in a fold by its hash. A part is a fold, or some in a row whose sums are in the first:
 *
 *     fold      0   1   2   3   4
 *     joined    -   -   x   x   -
 *     part     |0| |1         | |4|
 */
struct incise_factor {
	struct incise_design design; /* its gram is used for sums over folds */
	struct incise_gram *fold[FOLDS];
	bool joined[FOLDS]; /* with the one before */
	uint64_t groups[FOLDS], different[FOLDS];
	struct incise_model *model; /* of the premises, without consequents */
	char *premises;		    /* their text, and its hash */
	char hash[65];
	double min[INCISE_MODEL_INPUTS_MAX + 1], max[INCISE_MODEL_INPUTS_MAX + 1];
	struct incise_factor_source *sources;
	int n_sources;
	size_t capacity; /* of sources */
	int at;		 /* the source that pairs are added to */
	char version[40], options[INCISE_FACTOR_TEXT_MAX];
};

int incise_file_sha256(const char *path, char hex[65], struct incise_error *err)
{
	return incise_sha256_file(path, hex, NULL, NULL, err);
}

uint64_t incise_group_key(const char *source, const char *name)
{
	uint64_t key = 0;

	for (; *source; source++)
		key = incise_random_mix(key * 257 + (unsigned char)*source + 1);
	key = incise_random_mix(key + 0x9e3779b97f4a7c15ULL);
	for (; *name; name++)
		key = incise_random_mix(key * 257 + (unsigned char)*name + 1);
	return key;
}

/* --- premises ------------------------------------------------------------------------ */

static char *premises_text(const struct incise_model *model)
{
	const struct incise_model_info *info = incise_model_info(model);
	struct incise_c_locale locale = incise_c_locale_begin();
	char *text = NULL;
	size_t size;
	FILE *out = open_memstream(&text, &size);

	for (int i = 0; i < info->n_inputs && out; i++) {
		const struct incise_variable *v = &info->input[i];

		fprintf(out, "input %.17g %.17g %s %d %s\n", v->min, v->max,
			incise_mf_type_name(incise_model_mf(model, i, 0)->type),
			info->n_mfs[i], v->name);
		for (int k = 0; k < info->n_mfs[i]; k++) {
			const struct incise_mf *mf = incise_model_mf(model, i, k);

			fputs("mf", out);
			for (int p = 0; p < incise_mf_n_params(mf->type); p++)
				fprintf(out, " %.17g", mf->p[p]);
			fputc('\n', out);
		}
	}
	if (out)
		fprintf(out, "output %.17g %.17g %s\n", info->output.min,
			info->output.max, info->output.name);
	incise_c_locale_end(locale);
	if (!out || fclose(out)) {
		free(text);
		errno = ENOMEM;
		return NULL;
	}
	return text;
}

/* A model of its own without consequents: other factors rebuild the same one from the text. */
static struct incise_model *bare_model(const struct incise_model *from,
				       struct incise_error *err)
{
	const struct incise_model_info *info = incise_model_info(from);
	struct incise_variable inputs[INCISE_MODEL_INPUTS_MAX];
	enum incise_mf_type type = incise_model_mf(from, 0, 0)->type;
	struct incise_model *model;

	for (int i = 0; i < info->n_inputs; i++) {
		inputs[i] = info->input[i];
		for (int k = 0; k < info->n_mfs[i]; k++)
			if (incise_model_mf(from, i, k)->type != type)
				return INCISE_ERROR_NULL(
					err, ENOTSUP,
					"the premises have functions of several "
					"kinds; expected one kind");
		if (strchr(inputs[i].name, '\n'))
			inputs[i].name[strcspn(inputs[i].name, "\n")] = 0;
	}
	if (!(info->output.min < info->output.max))
		return INCISE_ERROR_NULL(
			err, EINVAL,
			"the premises' output has no range; give a model that "
			"incise train wrote");
	model = incise_model_new_grid(info->n_inputs, inputs, info->n_mfs, type,
				      &info->output, err);
	for (int i = 0; i < info->n_inputs && model; i++)
		for (int k = 0; k < info->n_mfs[i]; k++)
			incise_model_set_mf(model, i, k, incise_model_mf(from, i, k)->p);
	return model;
}

struct incise_factor *incise_factor_new(const struct incise_model *premises,
					struct incise_error *err)
{
	const struct incise_variable *out = &incise_model_info(premises)->output;
	struct incise_factor *factor = calloc(1, sizeof(*factor));
	int rc = factor ? 0 : -ENOMEM;

	if (factor) {
		factor->at = -1;
		snprintf(factor->version, sizeof(factor->version), "%s",
			 incise_version());
		rc = incise_design_init(&factor->design, premises, out->min, out->max);
	}
	if (!rc) {
		factor->model = bare_model(premises, err);
		if (!factor->model) {
			rc = -errno;
			goto out;
		}
		incise_design_free(&factor->design);
		rc = incise_design_init(&factor->design, factor->model, out->min,
					out->max);
		factor->premises = premises_text(factor->model);
		if (!factor->premises)
			rc = -ENOMEM;
	}
	for (int f = 0; f < FOLDS && !rc; f++) {
		factor->fold[f] =
			incise_gram_new(factor->design.basis.n_rules *
						(factor->design.basis.n_inputs + 1) +
					2);
		if (!factor->fold[f])
			rc = -ENOMEM;
	}
	if (!rc)
		rc = incise_sha256_text(factor->premises, strlen(factor->premises),
					factor->hash);
	if (rc)
		incise_error_set(
			err, -rc,
			rc == -ENOMEM ? "no memory for a factor"
				      : "the premises are no full grid of Gaussians or "
					"bells, all rules with weight 1");
out:
	if (rc) {
		incise_factor_free(factor);
		errno = -rc;
		return NULL;
	}
	return factor;
}

void incise_factor_free(struct incise_factor *factor)
{
	if (!factor)
		return;
	incise_design_free(&factor->design);
	for (int f = 0; f < FOLDS; f++)
		incise_gram_free(factor->fold[f]);
	incise_model_free(factor->model);
	free(factor->premises);
	free(factor->sources);
	free(factor);
}

/* --- sources and pairs --------------------------------------------------------------- */

/* One line of a text: what would end it is replaced. */
static void put_line(char *to, size_t size, const char *from)
{
	snprintf(to, size, "%s", from);
	for (; *to; to++)
		if ((unsigned char)*to < ' ')
			*to = ' ';
}

void incise_factor_set_options(struct incise_factor *factor, const char *options)
{
	put_line(factor->options, sizeof(factor->options), options);
}

static int find_source(const struct incise_factor *factor, const char *hash)
{
	for (int i = 0; i < factor->n_sources; i++)
		if (!strcmp(factor->sources[i].hash, hash))
			return i;
	return -1;
}

/* At its place by hash; -1: no memory. */
static int insert_source(struct incise_factor *factor,
			 const struct incise_factor_source *source)
{
	int at = factor->n_sources;

	if (!grow_array(&factor->sources, (size_t)at, &factor->capacity, 16,
			sizeof(*factor->sources)))
		return -1;
	for (; at > 0 && strcmp(factor->sources[at - 1].hash, source->hash) > 0; at--)
		factor->sources[at] = factor->sources[at - 1];
	factor->sources[at] = *source;
	factor->n_sources++;
	return at;
}

/* The identity in the next token of a recording (incise/origin.h), and its length; or NULL. */
static const char *next_identity(const char **text, size_t *n)
{
	static const char kind[] = "incise:1:recording:";
	const char *at = *text;

	while ((at = strstr(at, kind))) {
		at += sizeof(kind) - 1;
		at += strcspn(at, ":;"); /* head */
		at += *at == ':' ? 1 + strcspn(at + 1, ":;") : 0;
		at += *at == ':';
		*n = strcspn(at, ":;");
		*text = at;
		if (*n > 1)
			return at;
	}
	return NULL;
}

bool incise_is_same_recording(const char *a, const char *b)
{
	const char *p, *q, *rest;
	size_t n, m;

	while ((p = next_identity(&a, &n)))
		for (rest = b; (q = next_identity(&rest, &m));)
			if (n == m && !memcmp(p, q, n))
				return true;
	return false;
}

/* The name in a source's text, which goes on with its origins, or with the day of a recording. */
static int name_length(const char *text)
{
	static const char *const next[] = {", incise:", ", recorded "};
	size_t n = strlen(text);

	for (int i = 0; i < 2; i++) {
		const char *at = strstr(text, next[i]);

		if (at && (size_t)(at - text) < n)
			n = (size_t)(at - text);
	}
	return n < 200 ? (int)n : 200;
}

int incise_factor_start(struct incise_factor *factor, const char *hash, const char *text,
			struct incise_error *err)
{
	struct incise_factor_source source = {0};

	if (find_source(factor, hash) >= 0)
		return incise_error_set(err, EEXIST,
					"%.*s: this recording is there already, under "
					"another name or twice; give it once",
					name_length(text), text);
	snprintf(source.hash, sizeof(source.hash), "%s", hash);
	put_line(source.text, sizeof(source.text), text);
	factor->at = insert_source(factor, &source);
	return factor->at >= 0 ? 0 : incise_error_set(err, ENOMEM, "no memory");
}

static uint64_t rows_of(const struct incise_factor *factor)
{
	uint64_t rows = 0;

	for (int f = 0; f < FOLDS; f++)
		rows += incise_gram_rows(factor->fold[f]);
	return rows;
}

static int part_of(const struct incise_factor *factor, uint64_t group)
{
	int f = (int)(group % FOLDS);

	while (factor->joined[f])
		f--;
	return f;
}

int incise_factor_add(struct incise_factor *factor, const double *row, uint64_t group,
		      double weight, struct incise_error *err)
{
	const struct incise_model_info *info = incise_model_info(factor->model);
	int d = info->n_inputs;
	bool first = !rows_of(factor);
	int rc = incise_design_add_to(&factor->design,
				      factor->fold[part_of(factor, group)], row, weight);

	if (rc == -EOVERFLOW)
		return incise_error_set(err, EOVERFLOW, "more than 2^33 pairs");
	if (rc)
		return incise_error_set(
			err, ERANGE,
			"%s = %g is a whole range or more outside the model's %g to %g; "
			"remove the row, or train without --premises",
			info->output.name, row[d], info->output.min, info->output.max);
	for (int i = 0; i <= d; i++) {
		factor->min[i] = first ? row[i] : fmin(factor->min[i], row[i]);
		factor->max[i] = first ? row[i] : fmax(factor->max[i], row[i]);
	}
	if (factor->at >= 0)
		factor->sources[factor->at].rows++;
	return 0;
}

void incise_factor_count(struct incise_factor *factor, uint64_t group, uint64_t groups,
			 uint64_t different)
{
	int f = part_of(factor, group);

	factor->groups[f] += groups;
	factor->different[f] += different;
}

static uint64_t sum_of(const uint64_t *counts)
{
	uint64_t sum = 0;

	for (int f = 0; f < FOLDS; f++)
		sum += counts[f];
	return sum;
}

void incise_factor_info(const struct incise_factor *factor,
			struct incise_factor_info *info)
{
	*info = (struct incise_factor_info){
		.rows = rows_of(factor),
		.groups = sum_of(factor->groups),
		.different = sum_of(factor->different),
		.parts = FOLDS,
		.n_inputs = factor->design.basis.n_inputs,
		.n_rules = factor->design.basis.n_rules,
		.n_sources = factor->n_sources,
		.sources = factor->sources,
		.premises = factor->hash,
		.version = factor->version,
		.options = factor->options,
	};
	for (int f = 0; f < FOLDS; f++)
		info->parts -= factor->joined[f];
	memcpy(info->min, factor->min, sizeof(info->min));
	memcpy(info->max, factor->max, sizeof(info->max));
}

char *incise_factor_notes(const struct incise_factor *factor)
{
	char *text = NULL;
	size_t size;
	FILE *out = open_memstream(&text, &size);

	if (out)
		fprintf(out, "version: %s\noptions: %s\npremises: %s\n", factor->version,
			factor->options, factor->hash);
	for (int i = 0; i < factor->n_sources && out; i++)
		fprintf(out, "source: %s %llu pairs, %s\n", factor->sources[i].hash,
			(unsigned long long)factor->sources[i].rows,
			factor->sources[i].text);
	if (!out || fclose(out)) {
		free(text);
		errno = ENOMEM;
		return NULL;
	}
	return text;
}

/* --- parts --------------------------------------------------------------------------- */

/* Move the sums of joined folds to the first of their part. */
static void gather_parts(struct incise_factor *factor)
{
	for (int f = FOLDS - 1; f > 0; f--) {
		if (!factor->joined[f])
			continue;
		incise_gram_merge(factor->fold[f - 1], factor->fold[f]);
		incise_gram_reset(factor->fold[f]);
		factor->groups[f - 1] += factor->groups[f];
		factor->different[f - 1] += factor->different[f];
		factor->groups[f] = factor->different[f] = 0;
	}
}

/*
 * Pairs below which a part may reveal them. A pair has n inputs and an output unknown, so that
 * sums of fewer pairs than sums/(n + 1) determine them by counting; this is n + 1 times as many.
 */
static uint64_t least_pairs(const struct incise_factor *factor)
{
	uint64_t sums = incise_gram_count(factor->design.gram);

	return sums > INCISE_FACTOR_PAIRS_MIN ? sums : INCISE_FACTOR_PAIRS_MIN;
}

static bool is_revealing(const struct incise_factor *factor, int part)
{
	uint64_t rows = incise_gram_rows(factor->fold[part]);

	return rows && (rows < least_pairs(factor) ||
			factor->different[part] < least_pairs(factor) ||
			factor->groups[part] < INCISE_FACTOR_GROUPS_MIN);
}

static bool reveals_any(const struct incise_factor *factor)
{
	bool any = !rows_of(factor);

	for (int f = 0; f < FOLDS; f++)
		any |= is_revealing(factor, f);
	return any;
}

/* Join a part that reveals its pairs with the next ones, the last with those before it. */
static void join_parts(struct incise_factor *factor)
{
	int at = 0;

	for (int f = 1; f < FOLDS; f++) {
		if (!factor->joined[f] && !is_revealing(factor, at))
			at = f;
		factor->joined[f] |= at < f;
		gather_parts(factor);
	}
	while (at > 0 && is_revealing(factor, at)) {
		factor->joined[at] = true;
		gather_parts(factor);
		at = part_of(factor, (uint64_t)at);
	}
}

static int close_parts(struct incise_factor *factor, const char *path,
		       struct incise_error *err)
{
	join_parts(factor);
	if (!reveals_any(factor))
		return 0;
	return incise_error_set(
		err, ENODATA,
		"%s: %llu different pairs of %llu groups would be revealed; expected at "
		"least %llu pairs, for %zu sums, of %d groups (--group): add sources, or "
		"take fewer membership functions",
		path, (unsigned long long)sum_of(factor->different),
		(unsigned long long)sum_of(factor->groups),
		(unsigned long long)least_pairs(factor),
		incise_gram_count(factor->design.gram), INCISE_FACTOR_GROUPS_MIN);
}

/* --- merging ------------------------------------------------------------------------- */

static bool has_recording(const struct incise_factor *factor,
			  const struct incise_factor_source *source)
{
	bool has = find_source(factor, source->hash) >= 0;

	for (int i = 0; i < factor->n_sources && !has; i++)
		has = incise_is_same_recording(factor->sources[i].text, source->text);
	return has;
}

/* The reason, in words, why premises differ, or NULL. */
static const char *difference(const struct incise_factor *a,
			      const struct incise_factor *b)
{
	const struct incise_model_info *p = incise_model_info(a->model);
	const struct incise_model_info *q = incise_model_info(b->model);
	bool ranges = p->output.min == q->output.min && p->output.max == q->output.max;

	if (!strcmp(a->premises, b->premises))
		return NULL;
	if (p->n_inputs != q->n_inputs)
		return "has another number of inputs";
	if (strcmp(p->output.name, q->output.name))
		return "has another output, or another unit";
	for (int i = 0; i < p->n_inputs; i++) {
		if (strcmp(p->input[i].name, q->input[i].name))
			return "has other inputs, or other units";
		ranges &= p->input[i].min == q->input[i].min &&
			  p->input[i].max == q->input[i].max;
	}
	return ranges ? "has other membership functions" : "has other ranges, a scaling";
}

int incise_factor_merge(struct incise_factor *factor, struct incise_factor *other,
			const char *name, struct incise_error *err)
{
	const char *differs = difference(factor, other);
	uint64_t had = rows_of(factor), more = rows_of(other);

	if (differs)
		return incise_error_set(
			err, EINVAL, "%s: %s of its own; give factors of one --premises",
			name, differs);
	for (int i = 0; i < other->n_sources; i++)
		if (has_recording(factor, &other->sources[i]))
			return incise_error_set(
				err, EEXIST,
				"%s: the recording %.*s (SHA-256 %.12s) is in another "
				"factor too; merge it once",
				name, name_length(other->sources[i].text),
				other->sources[i].text, other->sources[i].hash);
	if (had + more > GRAM_ROWS_MAX)
		return incise_error_set(err, EOVERFLOW,
					"%s: more than 2^33 pairs together", name);
	for (int i = 0; i < other->n_sources; i++)
		if (insert_source(factor, &other->sources[i]) < 0)
			return incise_error_set(err, ENOMEM, "%s: no memory", name);
	for (int f = 0; f < FOLDS; f++) {
		incise_gram_merge(factor->fold[f], other->fold[f]);
		factor->joined[f] |= other->joined[f];
		factor->groups[f] += other->groups[f];
		factor->different[f] += other->different[f];
	}
	gather_parts(factor);
	for (int r = 0; r < factor->design.basis.n_rules; r++)
		factor->design.largest[r] =
			fmax(factor->design.largest[r], other->design.largest[r]);
	for (int i = 0; i <= factor->design.basis.n_inputs && more; i++) {
		factor->min[i] =
			had ? fmin(factor->min[i], other->min[i]) : other->min[i];
		factor->max[i] =
			had ? fmax(factor->max[i], other->max[i]) : other->max[i];
	}
	if (!had)
		memcpy(factor->options, other->options, sizeof(factor->options));
	else if (more && strcmp(factor->options, other->options))
		strcpy(factor->options, "different in the factors");
	factor->at = -1;
	return 0;
}

/* --- the file ------------------------------------------------------------------------ */

static void encode_text(const struct incise_factor *factor, FILE *out)
{
	int d = factor->design.basis.n_inputs;

	fprintf(out, "incise factor %d\nversion %s\npremises %s\n%soptions %s\n", FORM,
		factor->version, factor->hash, factor->premises, factor->options);
	fprintf(out, "sources %d\n", factor->n_sources);
	for (int i = 0; i < factor->n_sources; i++)
		fprintf(out, "source %s %llu %s\n", factor->sources[i].hash,
			(unsigned long long)factor->sources[i].rows,
			factor->sources[i].text);
	for (int i = 0; i <= d; i++)
		fprintf(out, "range %.17g %.17g\n", factor->min[i], factor->max[i]);
	for (int r = 0; r < factor->design.basis.n_rules; r++)
		fprintf(out, "fired %.17g\n", factor->design.largest[r]);
	for (int f = 0, next; f < FOLDS; f = next) {
		uint64_t different = factor->different[f], least = least_pairs(factor);

		for (next = f + 1; next < FOLDS && factor->joined[next];)
			next++;
		fprintf(out, "part %d %llu %llu %llu\n", next - f,
			(unsigned long long)incise_gram_rows(factor->fold[f]),
			(unsigned long long)(different < least ? different : least),
			(unsigned long long)factor->groups[f]);
	}
	fprintf(out, "sums %zu\n", incise_gram_count(factor->design.gram));
}

static void put_u64(FILE *out, uint64_t value)
{
	value = htole64(value);
	fwrite(&value, sizeof(value), 1, out);
}

void *incise_factor_encode(struct incise_factor *factor, size_t *size)
{
	struct incise_c_locale locale = incise_c_locale_begin();
	char *bytes = NULL;
	FILE *out = open_memstream(&bytes, size);
	uint32_t crc;

	if (out)
		encode_text(factor, out);
	incise_c_locale_end(locale);
	for (int f = 0; f < FOLDS && out; f++) {
		const incise_gram_sum *sum = incise_gram_sums(factor->fold[f]);

		for (size_t i = 0;
		     i < incise_gram_count(factor->fold[f]) && !factor->joined[f]; i++) {
			put_u64(out, (uint64_t)sum[i]);
			put_u64(out, (uint64_t)(sum[i] >> 64));
		}
	}
	if (out && !fflush(out)) {
		crc = htole32(incise_crc32c(0, bytes, *size));
		fwrite(&crc, sizeof(crc), 1, out);
	}
	if (!out || fclose(out)) {
		free(bytes);
		errno = ENOMEM;
		return NULL;
	}
	return bytes;
}

int incise_factor_save(struct incise_factor *factor, const char *path,
		       struct incise_error *err)
{
	size_t size;
	int rc = close_parts(factor, path, err);
	void *bytes = rc ? NULL : incise_factor_encode(factor, &size);
	struct incise_outfile *file;

	if (rc)
		return rc;
	if (!bytes)
		return incise_error_set(err, ENOMEM, "%s: no memory to write it", path);
	file = incise_outfile_open(path, err);
	rc = file ? 0 : -errno;
	if (file) {
		fwrite(bytes, 1, size, incise_outfile_stream(file));
		rc = incise_outfile_commit(file, err);
	}
	free(bytes);
	return rc;
}

struct decoder {
	const char *name;
	char *at, *end; /* of the text left */
	int line;
	struct incise_error *err;
};

static int damaged_factor(const struct decoder *in, const char *what)
{
	return incise_error_set(in->err, EINVAL,
				"%s:%d: %s; the file is damaged or no factor of incise "
				"train: write it again",
				in->name, in->line, what);
}

/* The rest of the next line behind "KEY ", or NULL. */
static char *next_factor_line(struct decoder *in, const char *key)
{
	size_t n = strlen(key);
	char *line = in->at, *end = memchr(line, '\n', (size_t)(in->end - line));

	in->line++;
	if (!end || (size_t)(end - line) < n + 1 || strncmp(line, key, n) ||
	    line[n] != ' ' || memchr(line, 0, (size_t)(end - line)))
		return NULL;
	*end = 0;
	in->at = end + 1;
	return line + n + 1;
}

static bool read_factor_number(char **text, double *value)
{
	char *end;

	*value = incise_decimal(*text, &end);
	if (end == *text || !isfinite(*value) || (*end && *end != ' '))
		return false;
	*text = *end ? end + 1 : end;
	return true;
}

/* A count up to a limit, at the end of a line or with the next behind a space. */
static bool whole(char **text, uint64_t max, uint64_t *value)
{
	bool digit = **text >= '0' && **text <= '9';
	char *end;

	errno = 0;
	*value = strtoull(*text, &end, 10);
	if (!digit || errno || *value > max || (*end && *end != ' '))
		return false;
	*text = *end ? end + 1 : end;
	return true;
}

static bool is_hash(const char *text)
{
	return strspn(text, "0123456789abcdef") == 64;
}

/* input MIN MAX KIND N NAME and its N lines mf …; parameters go to p. */
static int decode_input(struct decoder *in, char *line, struct incise_variable *v,
			int *n_mfs, enum incise_mf_type *type,
			double (*p)[BASIS_PARAMS_MAX + 1])
{
	const enum incise_mf_type kinds[] = {INCISE_MF_GAUSS, INCISE_MF_GBELL};
	bool known = false;
	char *end;
	long n;

	if (!read_factor_number(&line, &v->min) || !read_factor_number(&line, &v->max))
		return damaged_factor(in, "a range is no pair of numbers");
	for (int k = 0; k < 2 && !known; k++) {
		const char *name = incise_mf_type_name(kinds[k]);

		known = !strncmp(line, name, strlen(name)) && line[strlen(name)] == ' ';
		*type = kinds[k];
	}
	if (!known)
		return damaged_factor(
			in, "a kind of function is neither gaussmf nor gbellmf");
	line += strlen(incise_mf_type_name(*type)) + 1;
	n = strtol(line, &end, 10);
	if (n < 1 || n > INCISE_MODEL_MFS_MAX || *end != ' ' ||
	    strlen(end + 1) >= sizeof(v->name))
		return damaged_factor(
			in, "an input has no such number of functions and name");
	*n_mfs = (int)n;
	strcpy(v->name, end + 1);
	for (int k = 0; k < n; k++) {
		line = next_factor_line(in, "mf");
		for (int i = 0; i < incise_mf_n_params(*type); i++)
			if (!line || !read_factor_number(&line, &p[k][i]))
				return damaged_factor(
					in, "a function has no such parameters");
		if (*line)
			return damaged_factor(in, "a function has too many parameters");
	}
	return 0;
}

static struct incise_factor *decode_premises(struct decoder *in)
{
	struct incise_variable inputs[INCISE_MODEL_INPUTS_MAX] = {0}, output = {0};
	static const char *const grid = "the functions make no model";
	double p[INCISE_MODEL_INPUTS_MAX][INCISE_MODEL_MFS_MAX][BASIS_PARAMS_MAX + 1];
	enum incise_mf_type type = INCISE_MF_GAUSS, first = type;
	struct incise_error why = {0};
	int n_mfs[INCISE_MODEL_INPUTS_MAX], n = 0;
	struct incise_factor *factor;
	struct incise_model *model;
	char *line;

	while (n < INCISE_MODEL_INPUTS_MAX && (line = next_factor_line(in, "input"))) {
		if (decode_input(in, line, &inputs[n], &n_mfs[n], &type, p[n]))
			return NULL;
		if (n && type != first) {
			damaged_factor(in, "inputs have functions of several kinds");
			return NULL;
		}
		first = type;
		n++;
	}
	in->line -= n < INCISE_MODEL_INPUTS_MAX;
	line = next_factor_line(in, "output");
	if (!n || !line || !read_factor_number(&line, &output.min) ||
	    !read_factor_number(&line, &output.max) ||
	    strlen(line) >= sizeof(output.name)) {
		damaged_factor(in, "expected inputs and an output with its range");
		return NULL;
	}
	strcpy(output.name, line);
	model = incise_model_new_grid(n, inputs, n_mfs, first, &output, &why);
	for (int i = 0; i < n && model; i++)
		for (int k = 0; k < n_mfs[i] && model; k++)
			if (incise_model_set_mf(model, i, k, p[i][k])) {
				incise_model_free(model);
				model = NULL;
			}
	factor = model ? incise_factor_new(model, &why) : NULL;
	incise_model_free(model);
	if (!factor)
		damaged_factor(in, grid);
	return factor;
}

static int decode_sources(struct decoder *in, struct incise_factor *factor,
			  uint64_t *rows)
{
	char *line = next_factor_line(in, "options");
	uint64_t n;

	if (!line)
		return damaged_factor(in, "expected the options");
	incise_factor_set_options(factor, line);
	line = next_factor_line(in, "sources");
	if (!line || !whole(&line, SOURCES_MAX, &n) || *line)
		return damaged_factor(in, "expected a number of sources");
	for (uint64_t i = 0; i < n; i++) {
		struct incise_factor_source source = {0};
		char *end;

		line = next_factor_line(in, "source");
		if (!line || !is_hash(line) || line[64] != ' ' ||
		    (i && strncmp(factor->sources[i - 1].hash, line, 64) >= 0))
			return damaged_factor(in, "expected the next source by its hash");
		memcpy(source.hash, line, 64);
		source.rows = strtoull(line + 65, &end, 10);
		if (end == line + 65 || *end != ' ' || source.rows > GRAM_ROWS_MAX)
			return damaged_factor(in, "expected a number of pairs");
		put_line(source.text, sizeof(source.text), end + 1);
		*rows += source.rows;
		if (insert_source(factor, &source) < 0)
			return incise_error_set(in->err, ENOMEM, "%s: no memory",
						in->name);
	}
	return 0;
}

static int decode_statistics(struct decoder *in, struct incise_factor *factor,
			     uint64_t rows)
{
	uint64_t count, sum = 0;
	char *line;
	int next;

	for (int i = 0; i <= factor->design.basis.n_inputs; i++) {
		line = next_factor_line(in, "range");
		if (!line || !read_factor_number(&line, &factor->min[i]) ||
		    !read_factor_number(&line, &factor->max[i]) || *line ||
		    factor->min[i] > factor->max[i])
			return damaged_factor(in, "expected the range of a column");
	}
	for (int r = 0; r < factor->design.basis.n_rules; r++) {
		double *largest = &factor->design.largest[r];

		line = next_factor_line(in, "fired");
		if (!line || !read_factor_number(&line, largest) || *line ||
		    *largest < 0 || *largest > 1)
			return damaged_factor(in,
					      "expected the firing of a rule, 0 to 1");
	}
	for (int f = 0; f < FOLDS; f = next) {
		uint64_t folds, different, groups;

		line = next_factor_line(in, "part");
		if (!line || !whole(&line, FOLDS - f, &folds) || !folds ||
		    !whole(&line, GRAM_ROWS_MAX - 1, &count) ||
		    !whole(&line, GRAM_ROWS_MAX, &different) ||
		    !whole(&line, GRAM_ROWS_MAX, &groups) || *line)
			return damaged_factor(
				in, "expected folds, pairs and groups of a part");
		incise_factor_count(factor, (uint64_t)f, groups, different);
		incise_gram_set_rows(factor->fold[f], count);
		sum += count;
		for (next = f + (int)folds; --next > f;)
			factor->joined[next] = true;
		next = f + (int)folds;
	}
	if (sum != rows || sum > GRAM_ROWS_MAX)
		return damaged_factor(
			in, "sources and folds have different numbers of pairs");
	line = next_factor_line(in, "sums");
	if (!line || !whole(&line, SIZE_MAX, &count) || *line ||
	    count != incise_gram_count(factor->design.gram))
		return damaged_factor(in, "expected another number of sums");
	return 0;
}

/* No sum is larger than its rows allow, and the column of ones counts them. */
static int decode_sums(struct decoder *in, struct incise_factor *factor)
{
	size_t count = incise_gram_count(factor->design.gram), parts = 0;
	const char *from = in->at;

	for (int f = 0; f < FOLDS; f++)
		parts += !factor->joined[f];
	if ((size_t)(in->end - in->at) != parts * count * 2 * sizeof(uint64_t))
		return damaged_factor(in, "the sums are not as long as expected");
	for (int f = 0; f < FOLDS; f++) {
		incise_gram_sum *sum = incise_gram_sums(factor->fold[f]);
		incise_gram_sum rows = incise_gram_rows(factor->fold[f]);

		if (factor->joined[f])
			continue;
		for (size_t i = 0; i < count; i++, from += 16) {
			uint64_t word[2];

			memcpy(word, from, sizeof(word));
			sum[i] = (incise_gram_sum)((unsigned __int128)le64toh(word[1])
							   << 64 |
						   le64toh(word[0]));
			if (sum[i] > rows << 94 || sum[i] < -(rows << 94))
				return damaged_factor(in,
						      "a sum is too large for its pairs");
		}
		if (sum[count - 3] != rows << 92)
			return damaged_factor(in, "the sums do not count their pairs");
	}
	return 0;
}

static struct incise_factor *decode_factor(struct decoder *in, size_t size)
{
	struct incise_factor *factor = NULL;
	char *line, hash[65];
	uint64_t rows = 0, form;
	uint32_t crc;

	/* First, so that no line reaches into it. */
	in->end -= sizeof(crc);
	line = next_factor_line(in, "incise factor");
	if (!line || !whole(&line, UINT32_MAX, &form) || *line) {
		damaged_factor(in, "expected 'incise factor'");
		return NULL;
	}
	if (form < FORM)
		return INCISE_ERROR_NULL(
			in->err, ENOTSUP,
			"%s: is of the older form %llu: delete it, and train again by "
			"incise train -o FILE.fac",
			in->name, (unsigned long long)form);
	if (form != FORM)
		return INCISE_ERROR_NULL(
			in->err, ENOTSUP,
			"%s: is of form %llu, and this incise reads form %d; use "
			"the same version of incise everywhere",
			in->name, (unsigned long long)form, FORM);
	memcpy(&crc, in->end, sizeof(crc));
	*line = '\n';
	if (le32toh(crc) !=
	    incise_crc32c(0, in->end - (size - sizeof(crc)), size - sizeof(crc))) {
		damaged_factor(in, "the checksum does not fit");
		return NULL;
	}
	line = next_factor_line(in, "version");
	if (!line || strlen(line) >= sizeof(factor->version)) {
		damaged_factor(in, "expected a version");
		return NULL;
	}
	if (strcmp(line, incise_version()))
		return INCISE_ERROR_NULL(
			in->err, ENOTSUP,
			"%s: is of incise %s, and this is %s; use the same "
			"version everywhere",
			in->name, line, incise_version());
	line = next_factor_line(in, "premises");
	if (!line || !is_hash(line) || line[64]) {
		damaged_factor(in, "expected the premises' hash");
		return NULL;
	}
	memcpy(hash, line, sizeof(hash));
	factor = decode_premises(in);
	if (!factor)
		return NULL;
	if ((strcmp(hash, factor->hash) &&
	     damaged_factor(in, "the premises are not those of their hash")) ||
	    decode_sources(in, factor, &rows) || decode_statistics(in, factor, rows) ||
	    decode_sums(in, factor)) {
		incise_factor_free(factor);
		return NULL;
	}
	return factor;
}

struct incise_factor *incise_factor_decode(const void *bytes, size_t size,
					   const char *name, struct incise_error *err)
{
	struct incise_c_locale locale = incise_c_locale_begin();
	struct incise_error own = {0};
	struct decoder in = {.name = name, .err = err ? err : &own};
	struct incise_factor *factor = NULL;
	char *copy = malloc(size + 1);

	if (!copy) {
		incise_error_set(in.err, ENOMEM, "%s: no memory to read it", name);
	} else if (size < 64) {
		in.line = 1;
		damaged_factor(&in, "the file is too short");
	} else {
		memcpy(copy, bytes, size);
		copy[size] = 0;
		in.at = copy;
		in.end = copy + size;
		factor = decode_factor(&in, size);
	}
	free(copy);
	incise_c_locale_end(locale);
	if (!factor)
		errno = in.err->code;
	return factor;
}

struct incise_factor *incise_factor_load(const char *path, struct incise_error *err)
{
	static const struct incise_infile_kind kind = {
		.name = "a .fac file",
		.advice = "give a file that incise train -o FILE.fac wrote",
		.size_max = 256 << 20,
	};
	struct incise_factor *factor;
	size_t size;
	char *bytes = incise_infile_read(path, &kind, &size, err);

	if (!bytes)
		return NULL;
	factor = incise_factor_decode(bytes, size, path, err);
	free(bytes);
	if (factor && reveals_any(factor)) {
		incise_error_set(err, EINVAL,
				 "%s: a part of it reveals its pairs: expected at least "
				 "%llu different pairs of %d groups; write it again by "
				 "incise train -o FILE.fac",
				 path, (unsigned long long)least_pairs(factor),
				 INCISE_FACTOR_GROUPS_MIN);
		incise_factor_free(factor);
		errno = EINVAL;
		return NULL;
	}
	return factor;
}

/* --- solving ------------------------------------------------------------------------- */

/* The ridge without cross-validation, as that of a training. */
#define DEFAULT_RIDGE 1.0

/* Just enough that the standard deviation is finite where the user wants no ridge. */
#define LEAST_RIDGE 1e-9

struct solver {
	struct incise_factor *factor;
	struct incise_gram *all;
	struct incise_lsq *lsq;
	struct incise_scaling scaling;
	double mean, scale; /* of the target */
	double *x;
	int n;
};

/* Squared held-out errors of ridges, in squares of the scale. */
static int crossval(struct solver *s, const struct incise_ridge *ridges, int n_ridges,
		    double *errors)
{
	int rc = 0;

	memset(errors, 0, n_ridges * sizeof(*errors));
	for (int f = 0; f < FOLDS && !rc; f++) {
		struct incise_gram *held = s->factor->fold[f];

		if (!incise_gram_rows(held))
			continue;
		incise_gram_subtract(s->all, held);
		rc = incise_gram_factor(s->all, s->mean, s->scale, s->lsq);
		incise_gram_merge(s->all, held);
		for (int i = 0; i < n_ridges && !rc; i++) {
			rc = incise_lsq_solve(s->lsq, &ridges[i], s->x);
			errors[i] +=
				rc ? 0 : incise_gram_error(held, s->mean, s->scale, s->x);
		}
	}
	return rc;
}

static int choose_ridge(struct solver *s, const struct incise_factor_ridge *wanted,
			struct incise_ridge *ridge, double *held)
{
	struct incise_ridge ridges[CROSSVAL_RIDGES];
	double errors[CROSSVAL_RIDGES];
	int parts = 0, n = 1, rc;

	for (int f = 0; f < FOLDS; f++)
		parts += incise_gram_rows(s->factor->fold[f]) > 0;
	*held = NAN;
	if (isnan(wanted->ridge)) {
		incise_crossval_settings(&s->factor->design.basis, ridges);
		n = CROSSVAL_RIDGES;
	} else {
		ridges[0] = (struct incise_ridge){.ridge = wanted->ridge, .n = s->n};
	}
	*ridge = ridges[0];
	if (n > 1)
		ridge->ridge = DEFAULT_RIDGE;
	if (parts < 2 || (n == 1 && !isnan(wanted->noise)))
		return 0;
	if (n == 1)
		ridges[0].ridge = fmax(ridges[0].ridge, LEAST_RIDGE);
	rc = crossval(s, ridges, n, errors);
	for (int i = 0; i < n && !rc; i++)
		if (!(errors[i] >= *held)) {
			*held = errors[i];
			if (n > 1)
				*ridge = ridges[i];
		}
	*held = sqrt(*held / incise_gram_rows(s->all));
	return rc;
}

static void fill_report(struct solver *s, const struct incise_ridge *ridge, double held,
			struct incise_model *model, struct incise_train_report *report)
{
	const struct incise_design *design = &s->factor->design;

	*report = (struct incise_train_report){
		.ridge = ridge->ridge,
		.parameters = s->n + design->basis.n_premises,
		.check_rmse = NAN,
		.check_r2 = NAN,
		.crossval_rmse = held * s->scaling.scale[design->basis.n_inputs],
	};
	report->crossval_plane = report->crossval_mean = report->crossval_quadratic = NAN;
	report->epochs = report->best_epoch = 1;
	for (int r = 0; r < design->basis.n_rules; r++) {
		report->unfired[r] = design->largest[r] < DESIGN_UNFIRED;
		report->rules_unfired += report->unfired[r];
	}
	report->train_rmse = incise_factor_rmse(s->factor, model, &report->train_r2);
	incise_lsq_condition(s->lsq, &report->condition);
}

/* The errors of sums have no quantile, and no share that pairs of a group have in common. */
static int make_uncertainty(struct solver *s, const struct incise_ridge *wanted,
			    double noise, double held, const struct incise_model *model,
			    struct incise_uncertainty **uncertainty)
{
	struct incise_ridge ridge = *wanted;
	double scale = s->scaling.scale[s->factor->design.basis.n_inputs];
	const double *factor;
	int stride;

	ridge.ridge = fmax(ridge.ridge, LEAST_RIDGE);
	factor = incise_lsq_factor(s->lsq, &ridge, &stride);
	if (!factor)
		return -errno;
	if (isnan(held))
		held = sqrt(incise_gram_error(s->all, s->mean, s->scale, s->x) /
			    incise_gram_rows(s->all));
	if (isnan(noise))
		noise = held * scale *
			incise_interval_widening(sum_of(s->factor->groups));
	*uncertainty = incise_uncertainty_new(model, noise, factor, stride, NULL);
	return *uncertainty ? 0 : errno == ENOMEM ? -ENOMEM : -EDOM;
}

/* Sum of all folds, in the design's own matrix. */
static struct incise_gram *sum_folds(struct incise_factor *factor)
{
	incise_gram_reset(factor->design.gram);
	for (int f = 0; f < FOLDS; f++)
		incise_gram_merge(factor->design.gram, factor->fold[f]);
	return factor->design.gram;
}

struct incise_design *incise_factor_design(struct incise_factor *factor)
{
	sum_folds(factor);
	return &factor->design;
}

static int solve_factor(struct solver *s, const struct incise_factor_ridge *wanted,
			struct incise_train_report *report, struct incise_model *model,
			struct incise_uncertainty **uncertainty)
{
	struct incise_factor *factor = s->factor;
	struct incise_ridge ridge;
	double held, *raw = malloc(s->n * sizeof(*raw));
	int rc = raw ? 0 : -ENOMEM;

	s->all = sum_folds(factor);
	incise_design_target(&factor->design, s->all, &s->scaling, &s->mean, &s->scale);
	if (!rc)
		rc = choose_ridge(s, wanted, &ridge, &held);
	if (!rc)
		rc = incise_gram_factor(s->all, s->mean, s->scale, s->lsq);
	if (!rc)
		rc = incise_lsq_solve(s->lsq, &ridge, s->x);
	if (!rc) {
		memcpy(raw, s->x, s->n * sizeof(*raw));
		rc = incise_scaling_consequents(&s->scaling, factor->design.basis.n_rules,
						raw);
	}
	if (!rc)
		rc = incise_basis_set_consequents(model, raw);
	free(raw);
	if (!rc && report)
		fill_report(s, &ridge, held, model, report);
	if (!rc && uncertainty)
		rc = make_uncertainty(s, &ridge, wanted->noise, held, model, uncertainty);
	return rc;
}

struct incise_model *incise_factor_solve(struct incise_factor *factor,
					 const struct incise_factor_ridge *ridge,
					 struct incise_train_report *report,
					 struct incise_uncertainty **uncertainty,
					 struct incise_watch *watch,
					 struct incise_error *err)
{
	const struct incise_basis *basis = &factor->design.basis;
	struct solver s = {.factor = factor, .n = basis->n_rules * (basis->n_inputs + 1)};
	struct incise_model *model = incise_model_copy(factor->model);
	uint64_t different = sum_of(factor->different);
	uint64_t rows = different ? different : rows_of(factor);
	int rc = -ENODATA;

	s.lsq = incise_lsq_new(s.n, watch);
	s.x = malloc(s.n * sizeof(*s.x));
	if (!model || !s.lsq || !s.x)
		rc = -ENOMEM;
	else if (rows >= (uint64_t)s.n)
		rc = solve_factor(&s, ridge, report, model, uncertainty);
	if (!rc && watch && watch->stopped)
		rc = -ECANCELED;
	incise_lsq_free(s.lsq);
	free(s.x);
	if (!rc)
		return model;
	incise_model_free(model);
	if (watch && watch->stopped)
		incise_error_set(err, ECANCELED, "training was stopped");
	else if (rc == -ENODATA)
		incise_error_set(
			err, ENODATA,
			"%llu training pairs cannot determine the %d consequent "
			"parameters of %d rules; give fewer membership functions "
			"or record more",
			(unsigned long long)rows, s.n, basis->n_rules);
	else
		incise_error_set(err, -rc,
				 rc == -ENOMEM
					 ? "no memory to train"
					 : "least squares failed: the values are too "
					   "extreme; scale them or give fewer membership "
					   "functions");
	return NULL;
}

double incise_factor_rmse(struct incise_factor *factor, const struct incise_model *model,
			  double *r2)
{
	const struct incise_scaling *t = &factor->design.scaling;
	int d = t->n_inputs, n_rules = factor->design.basis.n_rules;
	struct incise_gram *all = sum_folds(factor);
	double rows = (double)incise_gram_rows(all), mean, sd, error;
	double *x = malloc((size_t)n_rules * (d + 1) * sizeof(*x));

	if (!x || !(rows > 0)) {
		free(x);
		if (r2)
			*r2 = NAN;
		return NAN;
	}
	/* Consequents for x in 0 … 1 and the target t. */
	for (int r = 0; r < n_rules; r++) {
		const double *p = incise_model_rule(model, r)->p;
		double *q = x + (size_t)r * (d + 1);

		q[0] = (p[0] - t->offset[d]) / t->scale[d];
		for (int i = 0; i < d; i++) {
			q[0] += p[i + 1] * t->offset[i] / t->scale[d];
			q[i + 1] = p[i + 1] * t->scale[i] / t->scale[d];
		}
	}
	error = incise_gram_error(all, 0, 1, x) / rows;
	incise_gram_target(all, &mean, &sd);
	if (r2)
		*r2 = sd > 1e-13 ? 1 - error / (sd * sd) : NAN;
	free(x);
	return sqrt(error) * t->scale[d];
}
