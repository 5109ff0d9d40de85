// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The standard deviation: its formula, and a file that is the same to the bit or refused.
 */
#include "../unit.h"
#include <incise/uncertainty.h>
#include "paper_model.h"

#define N 60

static char path[] = "/tmp/incise-sd-XXXXXX";
static double factor[N * N];

/* The noise doubles over the first input's 2 to 12, and is halved over the second's 0 to 40. */
static const struct incise_uncertainty_shape shape = {
	.offset = 0.5,
	.slope = {M_LN2, -M_LN2},
	.low = {2, 0},
	.high = {12, 40},
	.shared = 0.25,
};

static struct incise_uncertainty *make(const struct incise_model *model)
{
	uint64_t seed = 3;

	for (int i = 0; i < N; i++)
		for (int k = 0; k < N; k++)
			factor[i * N + k] = k == i  ? 2 + paper_random(&seed)
					    : k < i ? NAN /* is not read */
						    : 0.1 * paper_random(&seed);
	return incise_uncertainty_new(model, 0.25, factor, N, NULL);
}

/* noise²(1 + |R⁻ᵀφ|²), with R inverted column by column. */
static double by_formula(const struct incise_model *model, const double *x)
{
	static double inverse[N][N];
	double w[20], phi[N], sum = 1;

	for (int c = 0; c < N; c++)
		for (int i = N - 1; i >= 0; i--) {
			double v = i == c;

			for (int k = i + 1; k < N; k++)
				v -= factor[i * N + k] * inverse[k][c];
			inverse[i][c] = v / factor[i * N + i];
		}
	incise_model_firing(model, x, w);
	for (int r = 0; r < 20; r++) {
		phi[3 * r] = w[r];
		phi[3 * r + 1] = w[r] * x[0] / 20;
		phi[3 * r + 2] = w[r] * x[1] / 50;
	}
	for (int c = 0; c < N; c++) {
		double v = 0;

		for (int i = 0; i < N; i++)
			v += inverse[i][c] * phi[i];
		sum += v * v;
	}
	return 0.25 * sqrt(sum);
}

static struct incise_model *model;
static struct incise_uncertainty *u;

static int begin(void **state)
{
	model = paper_model(INCISE_MF_GAUSS, 1, 1);
	u = make(model);
	return 0;
}

static int end(void **state)
{
	incise_uncertainty_free(u);
	incise_model_free(model);
	return 0;
}

TEST(test_formula, begin, end)
{
	uint64_t seed = 8;

	assert_non_null(u);
	assert_true(incise_uncertainty_noise(u) == 0.25);
	for (int i = 0; i < 50; i++) {
		double x[] = {10 + 10 * paper_random(&seed),
			      25 + 25 * paper_random(&seed)};

		assert_true(fabs(incise_uncertainty_sd(u, model, x) -
				 by_formula(model, x)) < 1e-13);
	}
}

TEST(test_noise_by_the_inputs, begin, end)
{
	static const double points[][3] = {
		{0, 0, 1}, {7, 0, M_SQRT2}, {12, 20, M_SQRT2}, {20, 50, 1}, {2, 40, 0.5}};
	struct incise_uncertainty_parts flat, parts;
	struct incise_uncertainty_shape bad = shape;

	for (int i = 0; i < 5; i++) {
		double noise = 0.25 * exp(0.5) * points[i][2];

		assert_int_equal(incise_uncertainty_set_shape(
					 u, &(struct incise_uncertainty_shape){0}, NULL),
				 0);
		incise_uncertainty_parts(u, model, points[i], &flat);
		assert_true(flat.data == 0.25 && flat.mean == flat.model);
		assert_int_equal(incise_uncertainty_set_shape(u, &shape, NULL), 0);
		incise_uncertainty_parts(u, model, points[i], &parts);
		assert_true(fabs(parts.data - noise) < 1e-15);
		assert_true(fabs(parts.total / flat.total - noise / 0.25) < 1e-13);
		assert_true(fabs(parts.mean - hypot(parts.model, noise / 2)) < 1e-14);
	}
	assert_true(incise_uncertainty_noise(u) == 0.25);
	bad.high[1] = 0;
	assert_int_equal(incise_uncertainty_set_shape(u, &bad, NULL), -EINVAL);
	bad = shape;
	bad.shared = -0.1;
	assert_int_equal(incise_uncertainty_set_shape(u, &bad, NULL), -EINVAL);
}

TEST(test_any_input, begin, end)
{
	static const double odd[] = {0, -1e308, 1e308, 1e-310, NAN, INFINITY, -INFINITY};
	const double corner[] = {20, 0}, outside[] = {1e9, -5}, middle[] = {10, 25},
		     none[] = {NAN, NAN};

	for (int clamp = 0; clamp < 2; clamp++) {
		incise_model_set_clamp(model, clamp);
		for (int i = 0; i < 49; i++) {
			double x[] = {odd[i % 7], odd[i / 7]};
			double sd = incise_uncertainty_sd(u, model, x);

			assert_true(isfinite(sd) && sd >= 0.25);
		}
		assert_true(incise_uncertainty_sd(u, model, none) ==
			    incise_uncertainty_sd(u, model, middle));
	}
	assert_true(incise_uncertainty_sd(u, model, outside) ==
		    incise_uncertainty_sd(u, model, corner));
}

TEST(test_what_is_no_factor, begin, end)
{
	incise_uncertainty_free(make(model));
	assert_null(incise_uncertainty_new(model, -1, factor, N, NULL));
	assert_null(incise_uncertainty_new(model, NAN, factor, N, NULL));
	factor[5] = INFINITY;
	assert_null(incise_uncertainty_new(model, 1, factor, N, NULL));
	incise_uncertainty_free(make(model));
	factor[7 * N + 7] = 0;
	assert_null(incise_uncertainty_new(model, 1, factor, N, NULL));
	assert_int_equal(errno, EINVAL);
}

TEST(test_round_trip)
{
	struct incise_model *model = paper_model(INCISE_MF_GBELL, 1, 1e-9);
	struct incise_uncertainty *a = make(model), *b;
	struct incise_uncertainty_parts parts;
	uint64_t seed = 8;

	assert_int_equal(incise_uncertainty_save(a, path, &err), 0);
	b = incise_uncertainty_load(path, model, &err);
	assert_non_null(b);
	incise_uncertainty_parts(b, model, (double[]){3, 20}, &parts);
	assert_true(isnan(parts.mean) && isfinite(parts.total));
	incise_uncertainty_free(b);
	assert_int_equal(incise_uncertainty_set_shape(a, &shape, NULL), 0);
	assert_int_equal(incise_uncertainty_save(a, path, &err), 0);
	b = incise_uncertainty_load(path, model, &err);
	assert_non_null(b);
	for (int i = 0; i < 50; i++) {
		double x[] = {10 + 10 * paper_random(&seed),
			      25 + 25 * paper_random(&seed)};

		assert_true(incise_uncertainty_sd(a, model, x) ==
			    incise_uncertainty_sd(b, model, x));
	}
	incise_uncertainty_free(a);
	incise_uncertainty_free(b);
	incise_model_free(model);
}

/* One bit of one parameter, and it is another model. */
TEST(test_stale, begin, end)
{
	double p[3];

	assert_int_equal(incise_uncertainty_save(u, path, NULL), 0);
	incise_uncertainty_free(u);
	u = NULL;
	memcpy(p, incise_model_rule(model, 19)->p, sizeof(p));
	p[2] = nextafter(p[2], 10);
	incise_model_set_consequent(model, 19, p);
	assert_error(incise_uncertainty_load(path, model, &err), ESTALE, &err, path,
		     "stale");
	incise_model_free(model);
	model = paper_model(INCISE_MF_GAUSS, 1, 1);
	incise_model_set_mf(model, 1, 3, (double[]){9, 50, 0, 0});
	assert_null(incise_uncertainty_load(path, model, NULL));
	assert_int_equal(errno, ESTALE);
}

static char *read_all(size_t *size)
{
	FILE *file = fopen(path, "r");
	char *text = malloc(1 << 17);

	*size = fread(text, 1, 1 << 17, file);
	fclose(file);
	return text;
}

static void refused(const struct incise_model *model, const char *text, size_t size)
{
	struct incise_error err = {0};
	FILE *file = fopen(path, "w");

	fwrite(text, 1, size, file);
	fclose(file);
	/* Not recorded: cut anywhere, a file gives too many messages. */
	assert_null(incise_uncertainty_load(path, model, &err));
	assert_int_equal(err.code, EINVAL);
	assert_non_null(strstr(err.text, path));
}

struct change {
	const char *from, *to;
};

/* Cut anywhere but in the last digits and line end; changed in any of its parts. */
static void refuse_damage(const struct incise_model *model, const struct change *changes,
			  size_t n)
{
	size_t size;
	char *text = read_all(&size), *changed = malloc(1 << 17);

	for (size_t cut = 0; cut + 30 < size; cut += 97)
		refused(model, text, cut);
	for (size_t i = 0; i < n; i++) {
		char *at = memmem(text, size, changes[i].from, strlen(changes[i].from));
		size_t before = at - text, skip = strlen(changes[i].from);

		assert_non_null(at);
		memcpy(changed, text, before);
		strcpy(changed + before, changes[i].to);
		memcpy(changed + before + strlen(changes[i].to), at + skip,
		       size - before - skip);
		refused(model, changed, size + strlen(changes[i].to) - skip);
	}
	memcpy(changed, text, size);
	strcpy(changed + size, "1\n");
	refused(model, changed, size + 2);
	changed[size] = 0;
	refused(model, changed, size + 1);
	free(text);
	free(changed);
}

TEST(test_damage_is_refused, begin, end)
{
	static const struct change changes[] = {
		{"incise-sd 3", "incise-sd 2"},
		{"incise-sd 3", "incise-sd 4"},
		{"incise-sd 3", "incise-xd 3"},
		{"model ", "model 0"},
		{"model ", "model x"},
		{"unknowns 60", "unknowns 59"},
		{"unknowns 60", "unknowns 6e1"},
		{"noise 0.25", "noise -0.25"},
		{"noise 0.25", "noise nan"},
		{"noise 0.25", "noise 0.25 1"},
		{"noise 0.25", "noise 1e999"},
		{"shared -1", "shared -2"},
		{"shared -1", "shared nan"},
		{"shared -1", "shared 1 2"},
		{"offset 0", "offset inf"},
		{"slope 0 0 0", "slope 0 0"},
		{"slope 0 0 0", "slope 0 0 0 0"},
		{"slope 0 0 0", "slope 1 0 0"},
		{"rig 0\n", "rig 0\n0 "},
		{"rig 0\n", "rig 0\n1 "},
		{"rig 0\n", "rig 0\nx "},
	};
	/* With three lines of calibrations, the last one of ones. */
	static const struct change calibrations[] = {
		{"common 2", "common 61"},  {"common 2", "common -1"},
		{"common 2", "common 3"},   {"common 2", "common 1"},
		{"rig 1", "rig 65"},	    {"rig 1", "rig 0"},
		{"rig 1", "rog 1"},	    {"\n1 1 1 ", "\n1 1 "},
		{"\n1 1 1 ", "\n1 1 1 1 "}, {"\n1 1 1 ", "\n1 inf 1 "},
		{"\n1 1 1 ", "\n1 x 1 "},
	};
	double rows[3 * N];

	assert_int_equal(incise_uncertainty_save(u, path, NULL), 0);
	refuse_damage(model, changes, sizeof(changes) / sizeof(*changes));
	for (int i = 0; i < 3 * N; i++)
		rows[i] = i < 2 * N ? 0.1 : 1;
	assert_int_equal(incise_uncertainty_set_calibration(u, 0.25, rows, 2,
							    rows + 2 * N, 1, NULL),
			 0);
	assert_int_equal(incise_uncertainty_save(u, path, NULL), 0);
	refuse_damage(model, calibrations, sizeof(calibrations) / sizeof(*calibrations));
}

static int make_path(void **state)
{
	int fd = mkstemp(path);

	return fd < 0 ? -1 : close(fd);
}

static int remove_path(void **state)
{
	return unlink(path);
}

/* Calibrations: in a file, the same to the bit. */
TEST(test_calibrations, begin, end)
{
	struct incise_uncertainty *read;
	struct incise_uncertainty_parts a, b;
	double rows[3 * N], v[N], x[] = {7, 31}, phi[N], square = 0;
	uint64_t seed = 5;

	for (int i = 0; i < 3 * N; i++)
		rows[i] = 0.1 * paper_random(&seed);
	assert_int_equal(incise_uncertainty_unknowns(u), N);
	/* RᵀR v' = v */
	for (int i = 0; i < N; i++)
		v[i] = paper_random(&seed);
	memcpy(phi, v, sizeof(phi));
	assert_int_equal(incise_uncertainty_solve(u, phi), 0);
	for (int i = 0; i < N; i++) {
		double sum = 0;

		for (int j = 0; j <= i; j++)
			for (int k = j; k < N; k++)
				sum += factor[j * N + i] * factor[j * N + k] * phi[k];
		assert_true(fabs(sum - v[i]) < 1e-12);
	}
	rows[0] = NAN;
	assert_int_equal(incise_uncertainty_set_calibration(u, 0.2, rows, 2, rows, 1,
							    NULL),
			 -EINVAL);
	assert_true(incise_uncertainty_noise(u) == 0.25);
	rows[0] = 0.1;
	assert_int_equal(incise_uncertainty_set_calibration(u, 0.2, rows, 2, rows + 2 * N,
							    1, NULL),
			 0);
	incise_uncertainty_row(model, x, phi);
	for (int i = 0; i < N; i++)
		square += rows[2 * N + i] * phi[i];
	incise_uncertainty_parts(u, model, x, &a);
	assert_true(fabs(a.rig - fabs(square)) < 1e-15);
	assert_true(a.data == 0.2 && a.total > a.data);
	assert_int_equal(incise_uncertainty_save(u, path, NULL), 0);
	read = incise_uncertainty_load(path, model, NULL);
	assert_non_null(read);
	incise_uncertainty_parts(read, model, x, &b);
	assert_memory_equal(&a, &b, sizeof(a));
	incise_uncertainty_free(read);
}

GROUP(make_path, remove_path);
