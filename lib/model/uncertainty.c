// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The predictive standard deviation and its file; see incise/uncertainty.h and
 * incise-sd(5).
 */
#include <errno.h>
#include <float.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/outfile.h>
#include <incise/uncertainty.h>
#include "../base/c_locale.h"
#include "../base/lines.h"
#include "model.h"

#define VERSION 3
#define UNKNOWN -1.0 /* share that is not known, in a file */

#define UNKNOWNS_MAX (INCISE_MODEL_RULES_MAX * (INCISE_MODEL_INPUTS_MAX + 1))

struct incise_uncertainty {
	uint64_t checksum; /* of the model */
	int n, n_inputs;
	double noise;
	struct incise_uncertainty_shape shape;
	double *factor; /* upper triangle, row by row, packed */
	/* Rows k of n: |k φ|² is a variance. Of the training's rigs; of another rig. */
	int n_common, n_rig;
	double *calibration; /* of both, after each other */
};

static int calibrations(const struct incise_uncertainty *u)
{
	return u->n_common + u->n_rig;
}

/* FNV-1a of the numbers that the output depends on, in the machine's double format. */
static void sum(uint64_t *hash, double value)
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

static uint64_t checksum(const struct incise_model *model)
{
	int d = model->info.n_inputs, n_rules = model->info.n_rules;
	uint64_t hash = 0xcbf29ce484222325;

	sum(&hash, d);
	for (int i = 0; i < d; i++) {
		const struct incise_variable *v = &model->info.input[i];

		sum(&hash, v->min);
		sum(&hash, v->max);
		for (int k = 0; k < model->info.n_mfs[i]; k++) {
			const struct incise_mf *mf = incise_model_mf(model, i, k);

			for (const char *c = incise_mf_type_name(mf->type); *c; c++)
				sum(&hash, *c);
			for (int j = 0; j < incise_mf_n_params(mf->type); j++)
				sum(&hash, mf->p[j]);
		}
	}
	for (int r = 0; r < n_rules; r++) {
		sum(&hash, model->rule[r].weight);
		for (int i = 0; i < d; i++)
			sum(&hash, incise_model_rule(model, r)->mf[i]);
		for (int i = 0; i <= d; i++)
			sum(&hash, incise_model_rule(model, r)->p[i]);
	}
	return hash;
}

static int unknowns(const struct incise_model *model)
{
	return model->info.n_rules * (model->info.n_inputs + 1);
}

static struct incise_uncertainty *make(const struct incise_model *model)
{
	struct incise_uncertainty *u = calloc(1, sizeof(*u));
	size_t n = unknowns(model);

	if (!u)
		return NULL;
	u->n = (int)n;
	u->n_inputs = model->info.n_inputs;
	u->checksum = checksum(model);
	u->shape.shared = NAN;
	u->factor = malloc(n * (n + 1) / 2 * sizeof(*u->factor));
	if (!u->factor) {
		free(u);
		errno = ENOMEM;
		return NULL;
	}
	return u;
}

struct incise_uncertainty *incise_uncertainty_new(const struct incise_model *model,
						  double noise, const double *factor,
						  size_t stride, struct incise_error *err)
{
	struct incise_uncertainty *u = make(model);
	bool good = isfinite(noise) && noise >= 0;
	double *to;

	if (!u)
		return INCISE_ERROR_NULL(err, ENOMEM,
					 "no memory for the standard deviation");
	u->noise = noise;
	to = u->factor;
	for (int i = 0; i < u->n; i++)
		for (int k = i; k < u->n; k++) {
			*to = factor[i * stride + k];
			good &= isfinite(*to) && (k > i || *to != 0);
			to++;
		}
	if (!good) {
		incise_uncertainty_free(u);
		return INCISE_ERROR_NULL(
			err, EINVAL,
			"no standard deviation: its factor is singular or not "
			"finite; use a ridge");
	}
	return u;
}

void incise_uncertainty_free(struct incise_uncertainty *uncertainty)
{
	if (!uncertainty)
		return;
	free(uncertainty->factor);
	free(uncertainty->calibration);
	free(uncertainty);
}

/* Room for rows of calibrations. Returns 0 or -ENOMEM. */
static int make_calibrations(struct incise_uncertainty *u, int n_common, int n_rig)
{
	size_t n = (size_t)(n_common + n_rig) * (size_t)u->n;
	double *rows = n ? malloc(n * sizeof(*rows)) : NULL;

	if (n && !rows)
		return -ENOMEM;
	free(u->calibration);
	u->calibration = rows;
	u->n_common = n_common;
	u->n_rig = n_rig;
	return 0;
}

int incise_uncertainty_set_calibration(struct incise_uncertainty *u, double noise,
				       const double *common, int n_common,
				       const double *rig, int n_rig,
				       struct incise_error *err)
{
	size_t n = (size_t)u->n;
	bool good = isfinite(noise) && noise >= 0 && n_common >= 0 && n_rig >= 0 &&
		    n_common <= u->n && n_rig <= INCISE_UNCERTAINTY_SOURCES;

	for (size_t i = 0; good && i < (size_t)n_common * n; i++)
		good = isfinite(common[i]);
	for (size_t i = 0; good && i < (size_t)n_rig * n; i++)
		good = isfinite(rig[i]);
	if (!good)
		return incise_error_set(err, EINVAL,
					"the uncertainty of the calibrations is not "
					"finite, or has too many parts");
	if (make_calibrations(u, n_common, n_rig))
		return incise_error_set(err, ENOMEM,
					"no memory for the standard deviation");
	u->noise = noise;
	if (n_common)
		memcpy(u->calibration, common, (size_t)n_common * n * sizeof(*common));
	if (n_rig)
		memcpy(u->calibration + (size_t)n_common * n, rig,
		       (size_t)n_rig * n * sizeof(*rig));
	return 0;
}

int incise_uncertainty_unknowns(const struct incise_uncertainty *u)
{
	return u->n;
}

int incise_uncertainty_solve(const struct incise_uncertainty *u, double *v)
{
	const double *row = u->factor, *end;
	bool good = true;

	for (int i = 0; i < u->n; i++) {
		v[i] /= *row++;
		for (int k = i + 1; k < u->n; k++)
			v[k] -= *row++ * v[i];
	}
	/* Back through the rows, the last of which ends the triangle. */
	end = u->factor + (size_t)u->n * ((size_t)u->n + 1) / 2;
	for (int i = u->n - 1; i >= 0; i--) {
		end -= u->n - i;
		for (int k = i + 1; k < u->n; k++)
			v[i] -= end[k - i] * v[k];
		v[i] /= end[0];
		good &= isfinite(v[i]);
	}
	return good ? 0 : -EDOM;
}

int incise_uncertainty_set_shape(struct incise_uncertainty *u,
				 const struct incise_uncertainty_shape *shape,
				 struct incise_error *err)
{
	bool good =
		isfinite(shape->offset) && !isinf(shape->shared) && !(shape->shared < 0);

	for (int i = 0; i < u->n_inputs; i++)
		good = good && isfinite(shape->slope[i]) && isfinite(shape->low[i]) &&
		       isfinite(shape->high[i]) &&
		       (shape->slope[i] == 0 || shape->high[i] > shape->low[i]);
	if (!good)
		return incise_error_set(
			err, EINVAL,
			"the noise does not depend on the inputs by finite "
			"slopes over rising ranges");
	u->shape = *shape;
	return 0;
}

double incise_uncertainty_noise(const struct incise_uncertainty *uncertainty)
{
	return uncertainty->noise;
}

static double limit_input(const struct incise_model *model, int i, double x)
{
	const struct incise_variable *v = &model->info.input[i];

	if (isnan(x))
		return v->min + (v->max - v->min) / 2;
	return model->clamp ? fmax(v->min, fmin(v->max, x))
			    : fmax(-DBL_MAX, fmin(DBL_MAX, x));
}

void incise_uncertainty_row(const struct incise_model *model, const double *x,
			    double *phi)
{
	double in[INCISE_MODEL_INPUTS_MAX], w[INCISE_MODEL_RULES_MAX], *at = phi;

	for (int i = 0; i < model->info.n_inputs; i++)
		in[i] = limit_input(model, i, x[i]);
	incise_model_firing(model, in, w);
	for (int r = 0; r < model->info.n_rules; r++) {
		*at++ = w[r];
		for (int i = 0; i < model->info.n_inputs; i++) {
			const struct incise_variable *v = &model->info.input[i];

			*at++ = w[r] > 0 ? w[r] * ((in[i] - v->min) / (v->max - v->min))
					 : 0;
		}
	}
}

/* Σ (k φ)² over some rows of calibrations. */
static double square(const struct incise_uncertainty *u, const double *phi, int first,
		     int n)
{
	const double *row;
	double sum = 0;

	if (!n)
		return 0;
	row = u->calibration + (size_t)first * (size_t)u->n;
	for (int i = 0; i < n; i++) {
		double product = 0;

		for (int k = 0; k < u->n; k++)
			product += *row++ * phi[k];
		sum += product * product;
	}
	return sum;
}

/* Only far outside can it overflow, or be inf - inf. */
static double bounded(double sd)
{
	return isfinite(sd) ? sd : DBL_MAX;
}

/* |R⁻ᵀφ|², and φ is lost: forward substitution with Rᵀ, a row of R at a time. */
static double leverage(const struct incise_uncertainty *uncertainty, double *phi)
{
	const double *row = uncertainty->factor;
	double sum = 0;

	for (int i = 0; i < uncertainty->n; i++) {
		double v = phi[i] / *row++;

		sum += v * v;
		for (int k = i + 1; k < uncertainty->n; k++)
			phi[k] -= *row++ * v;
	}
	return sum;
}

static double noise_at(const struct incise_uncertainty *u,
		       const struct incise_model *model, const double *x)
{
	const struct incise_uncertainty_shape *shape = &u->shape;
	double sum = shape->offset;

	for (int i = 0; i < u->n_inputs; i++) {
		double low = shape->low[i], high = shape->high[i];
		double in = fmax(low, fmin(high, limit_input(model, i, x[i])));

		if (shape->slope[i] != 0)
			sum += shape->slope[i] * ((in - low) / (high - low));
	}
	return bounded(u->noise * exp(sum));
}

void incise_uncertainty_parts(const struct incise_uncertainty *u,
			      const struct incise_model *model, const double *x,
			      struct incise_uncertainty_parts *parts)
{
	double phi[UNKNOWNS_MAX], common, rig, model_square, mean_square;
	double noise = noise_at(u, model, x), shared = u->shape.shared;

	incise_uncertainty_row(model, x, phi);
	common = square(u, phi, 0, u->n_common);
	rig = square(u, phi, u->n_common, u->n_rig);
	model_square = leverage(u, phi);
	mean_square = noise * noise * (shared + model_square) + common;
	*parts = (struct incise_uncertainty_parts){
		.total = bounded(sqrt(noise * noise * (1 + model_square) + common + rig)),
		.data = noise,
		.model = bounded(noise * sqrt(model_square)),
		.calibration = bounded(sqrt(common)),
		.rig = bounded(sqrt(rig)),
		.mean = isnan(shared) ? NAN : bounded(sqrt(mean_square)),
	};
}

void incise_uncertainty_parts_many(const struct incise_uncertainty *uncertainty,
				   const struct incise_model *model, const double *x,
				   size_t n, struct incise_uncertainty_parts *parts)
{
	for (size_t k = 0; k < n; k++)
		incise_uncertainty_parts(uncertainty, model,
					 x + k * (size_t)model->info.n_inputs, &parts[k]);
}

double incise_uncertainty_sd(const struct incise_uncertainty *uncertainty,
			     const struct incise_model *model, const double *x)
{
	struct incise_uncertainty_parts parts;

	incise_uncertainty_parts(uncertainty, model, x, &parts);
	return parts.total;
}

#define fail incise_lines_error

/* Next line that is not empty or a comment: 1, or 0 at the end. */
static int next_uncertainty_line(struct incise_lines *in)
{
	int rc;

	do
		rc = incise_lines_next(in, " \t\r\n");
	while (rc > 0 && (!*in->text || *in->text == '#'));
	return rc;
}

/* The line "KEY VALUE": its value, or NULL. */
static char *value_of(struct incise_lines *in, const char *key)
{
	size_t length = strlen(key);
	int rc = next_uncertainty_line(in);

	if (rc < 0)
		return NULL;
	if (!rc || strncmp(in->text, key, length) || in->text[length] != ' ') {
		fail(in, EINVAL, "expected '%s', found '%.40s': not a .sd file", key,
		     rc ? in->text : "the end");
		return NULL;
	}
	return in->text + length + 1;
}

static int integer_of(struct incise_lines *in, const char *key, long *value)
{
	char *text = value_of(in, key), *end;

	if (!text)
		return -errno;
	errno = 0;
	*value = strtol(text, &end, 10);
	if (end == text || *end || errno)
		return fail(in, EINVAL, "%s: '%.40s' is not a whole number", key, text);
	return 0;
}

/* A finite number at *at, behind one space for all but the first. */
static int read_uncertainty_number(struct incise_lines *in, char **at, double *value)
{
	char *end;

	*value = incise_decimal(*at, &end);
	if (end == *at || (*end && *end != ' '))
		return fail(in, EINVAL, "'%.30s' is not a number", *at);
	if (!isfinite(*value))
		return fail(in, EINVAL, "'%.*s' is not finite", (int)(end - *at), *at);
	*at = end;
	return 0;
}

/* So many numbers of a line, from *at on. */
static int numbers(struct incise_lines *in, char **at, double *to, int n)
{
	int rc = 0;

	for (int k = 0; k < n && !rc; k++)
		rc = read_uncertainty_number(in, at, to + k);
	return rc;
}

/* The line "KEY NUMBERS…" of so many. */
static int numbers_of(struct incise_lines *in, const char *key, double *to, int n)
{
	char *at = value_of(in, key);
	int rc = at ? numbers(in, &at, to, n) : -errno;

	if (!rc && *at)
		return fail(in, EINVAL, "%s: expected no more than %s", key,
			    n == 1 ? "one number" : "three numbers");
	return rc;
}

/* A row of the triangle, or of the calibrations: a line of n numbers. */
static int read_row(struct incise_lines *in, double *to, int n)
{
	int rc = next_uncertainty_line(in);
	char *at = in->text;

	if (!rc)
		return fail(in, EINVAL,
			    "the file ends before its last row: it is truncated; train "
			    "again");
	rc = rc < 0 ? rc : numbers(in, &at, to, n);
	if (!rc && *at)
		return fail(in, EINVAL, "a row has more than %d numbers", n);
	return rc;
}

static int read_noise(struct incise_lines *in, struct incise_uncertainty *u)
{
	struct incise_uncertainty_shape shape = {0};
	int rc = numbers_of(in, "noise", &u->noise, 1);

	if (!rc && u->noise < 0)
		return fail(in, EINVAL, "noise: expected a number that is not negative");
	if (!rc)
		rc = numbers_of(in, "shared", &shape.shared, 1);
	if (shape.shared == UNKNOWN)
		shape.shared = NAN;
	if (!rc)
		rc = numbers_of(in, "offset", &shape.offset, 1);
	for (int i = 0; i < u->n_inputs && !rc; i++) {
		double slope[3];

		rc = numbers_of(in, "slope", slope, 3);
		shape.slope[i] = slope[0];
		shape.low[i] = slope[1];
		shape.high[i] = slope[2];
	}
	if (!rc && incise_uncertainty_set_shape(u, &shape, NULL))
		return fail(
			in, EINVAL,
			"expected shared of at least 0, or -1, and slopes over rising ranges");
	return rc;
}

static int read_uncertainty_file(struct incise_lines *in, struct incise_uncertainty *u)
{
	double *to = u->factor;
	char *text, *end;
	uint64_t sum;
	long value, n_common, n_rig;
	int rc = integer_of(in, "incise-sd", &value);

	if (rc)
		return rc;
	if (value != VERSION)
		return fail(in, EINVAL,
			    "version %ld: this incise reads version %d; train again",
			    value, VERSION);
	text = value_of(in, "model");
	if (!text)
		return -errno;
	sum = strtoull(text, &end, 16);
	if (strspn(text, "0123456789abcdef") != 16 || *end)
		return fail(in, EINVAL, "model: '%.40s' is not a checksum of 16 digits",
			    text);
	if (sum != u->checksum)
		return fail(in, ESTALE,
			    "stale: made for other parameters of the model; train "
			    "again, or remove it");
	rc = integer_of(in, "unknowns", &value);
	if (rc)
		return rc;
	if (value != u->n)
		return fail(in, EINVAL, "unknowns: %ld, the model has %d", value, u->n);
	rc = read_noise(in, u);
	if (!rc)
		rc = integer_of(in, "common", &n_common);
	if (!rc)
		rc = integer_of(in, "rig", &n_rig);
	if (rc)
		return rc;
	if (n_common < 0 || n_common > u->n || n_rig < 0 ||
	    n_rig > INCISE_UNCERTAINTY_SOURCES)
		return fail(in, EINVAL,
			    "expected at most %d common and %d rig calibrations", u->n,
			    INCISE_UNCERTAINTY_SOURCES);
	if (make_calibrations(u, (int)n_common, (int)n_rig))
		return fail(in, ENOMEM, "no memory to read it");
	for (int row = 0; row < u->n && !rc; to += u->n - row, row++) {
		rc = read_row(in, to, u->n - row);
		if (!rc && *to == 0)
			return fail(in, EINVAL,
				    "row %d begins with 0: the factor is singular",
				    row + 1);
	}
	for (int i = 0; i < calibrations(u) && !rc; i++)
		rc = read_row(in, u->calibration + (size_t)i * (size_t)u->n, u->n);
	if (rc)
		return rc;
	rc = next_uncertainty_line(in);
	if (rc > 0)
		return fail(in, EINVAL, "'%.20s' after the last row", in->text);
	return rc;
}

struct incise_uncertainty *incise_uncertainty_load(const char *path,
						   const struct incise_model *model,
						   struct incise_error *err)
{
	/* 2304 unknowns, half of a matrix in 25 bytes a number, are 66 MB. */
	static const struct incise_infile_kind sd = {
		.name = "a .sd file",
		.advice = "'incise train' writes it next to a model",
		.size_max = 128 << 20,
	};
	struct incise_uncertainty *u = make(model);
	struct incise_lines in;
	int rc;

	if (!u)
		return INCISE_ERROR_NULL(err, ENOMEM, "%s: no memory to read it", path);
	rc = incise_lines_open(&in, path, &sd, err);
	if (!rc) {
		rc = read_uncertainty_file(&in, u);
		incise_lines_close(&in);
	}
	if (rc) {
		incise_uncertainty_free(u);
		errno = -rc;
		return NULL;
	}
	return u;
}

/* Returns what comes behind the row. */
static const double *write_row(FILE *out, const double *row, int n)
{
	for (int k = 0; k < n; k++)
		fprintf(out, "%.17g%c", row[k], k + 1 < n ? ' ' : '\n');
	return row + n;
}

int incise_uncertainty_save(const struct incise_uncertainty *uncertainty,
			    const char *path, struct incise_error *err)
{
	struct incise_outfile *file = incise_outfile_open(path, err);
	const struct incise_uncertainty_shape *shape = &uncertainty->shape;
	const double *from = uncertainty->factor;
	struct incise_c_locale locale;
	FILE *out;

	if (!file)
		return -errno;
	locale = incise_c_locale_begin();
	out = incise_outfile_stream(file);
	fprintf(out,
		"incise-sd %d\nmodel %016" PRIx64 "\nunknowns %d\nnoise %.17g\n"
		"shared %.17g\noffset %.17g\n",
		VERSION, uncertainty->checksum, uncertainty->n, uncertainty->noise,
		isnan(shape->shared) ? UNKNOWN : shape->shared, shape->offset);
	for (int i = 0; i < uncertainty->n_inputs; i++)
		fprintf(out, "slope %.17g %.17g %.17g\n", shape->slope[i], shape->low[i],
			shape->high[i]);
	fprintf(out, "common %d\nrig %d\n", uncertainty->n_common, uncertainty->n_rig);
	for (int i = 0; i < uncertainty->n; i++)
		from = write_row(out, from, uncertainty->n - i);
	from = uncertainty->calibration;
	for (int i = 0; i < calibrations(uncertainty); i++)
		from = write_row(out, from, uncertainty->n);
	incise_c_locale_end(locale);
	return incise_outfile_commit(file, err);
}

void incise_uncertainty_sd_many(const struct incise_uncertainty *uncertainty,
				const struct incise_model *model, const double *x,
				size_t n, double *sd)
{
	for (size_t k = 0; k < n; k++)
		sd[k] = incise_uncertainty_sd(uncertainty, model,
					      x + k * (size_t)model->info.n_inputs);
}
