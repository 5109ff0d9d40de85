// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The predictive standard deviation and its file; see incise/uncertainty.h and
 * incise-sd(5).
 */
#include <errno.h>
#include <float.h>
#include <inttypes.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/outfile.h>
#include <incise/uncertainty.h>
#include "../base/c_locale.h"
#include "companion.h"
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
	u->checksum = incise_model_checksum(model);
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

static bool is_inside(const struct incise_model *model, const double *x)
{
	unsigned int flags = 0;

	incise_model_eval(model, x, &flags);
	return !(flags & INCISE_MODEL_EXTRAPOLATED);
}

void incise_uncertainty_parts_many(const struct incise_uncertainty *uncertainty,
				   const struct incise_model *model, const double *x,
				   size_t n, struct incise_uncertainty_parts *parts)
{
	for (size_t k = 0; k < n; k++, x += model->info.n_inputs)
		if (is_inside(model, x))
			incise_uncertainty_parts(uncertainty, model, x, &parts[k]);
		else
			parts[k] = (struct incise_uncertainty_parts){NAN, NAN, NAN,
								     NAN, NAN, NAN};
}

double incise_uncertainty_sd(const struct incise_uncertainty *uncertainty,
			     const struct incise_model *model, const double *x)
{
	struct incise_uncertainty_parts parts;

	incise_uncertainty_parts(uncertainty, model, x, &parts);
	return parts.total;
}

#define fail incise_lines_error

static int read_noise(struct incise_lines *in, struct incise_uncertainty *u)
{
	struct incise_uncertainty_shape shape = {0};
	int rc = incise_companion_numbers(in, "noise", &u->noise, 1);

	if (!rc && u->noise < 0)
		return fail(in, EINVAL, "noise: expected a number that is not negative");
	if (!rc)
		rc = incise_companion_numbers(in, "shared", &shape.shared, 1);
	if (shape.shared == UNKNOWN)
		shape.shared = NAN;
	if (!rc)
		rc = incise_companion_numbers(in, "offset", &shape.offset, 1);
	for (int i = 0; i < u->n_inputs && !rc; i++) {
		double slope[3];

		rc = incise_companion_numbers(in, "slope", slope, 3);
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
	long value, n_common, n_rig;
	int rc = incise_companion_head(in, "incise-sd", VERSION, &u->checksum);

	if (!rc)
		rc = incise_companion_whole(in, "unknowns", LONG_MIN, LONG_MAX, &value);
	if (rc)
		return rc;
	if (value != u->n)
		return fail(in, EINVAL, "unknowns: %ld, the model has %d", value, u->n);
	rc = read_noise(in, u);
	if (!rc)
		rc = incise_companion_whole(in, "common", 0, u->n, &n_common);
	if (!rc)
		rc = incise_companion_whole(in, "rig", 0, INCISE_UNCERTAINTY_SOURCES,
					    &n_rig);
	if (rc)
		return rc;
	if (make_calibrations(u, (int)n_common, (int)n_rig))
		return fail(in, ENOMEM, "no memory to read it");
	for (int row = 0; row < u->n && !rc; to += u->n - row, row++) {
		rc = incise_companion_row(in, to, u->n - row);
		if (!rc && *to == 0)
			return fail(in, EINVAL,
				    "row %d begins with 0: the factor is singular",
				    row + 1);
	}
	for (int i = 0; i < calibrations(u) && !rc; i++)
		rc = incise_companion_row(in, u->calibration + (size_t)i * (size_t)u->n,
					  u->n);
	return rc ? rc : incise_companion_end(in);
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
	for (int n = uncertainty->n; n > 0; from += n--)
		incise_companion_write_row(out, from, n);
	from = uncertainty->calibration;
	for (int i = 0; i < calibrations(uncertainty); i++, from += uncertainty->n)
		incise_companion_write_row(out, from, uncertainty->n);
	incise_c_locale_end(locale);
	return incise_outfile_commit(file, err);
}

void incise_uncertainty_sd_many(const struct incise_uncertainty *uncertainty,
				const struct incise_model *model, const double *x,
				size_t n, double *sd)
{
	for (size_t k = 0; k < n; k++, x += model->info.n_inputs)
		sd[k] = is_inside(model, x) ? incise_uncertainty_sd(uncertainty, model, x)
					    : NAN;
}
