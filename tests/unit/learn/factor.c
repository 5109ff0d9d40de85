// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Factors: any division of the pairs gives the same bytes, a file is read as it was written, and
 * the solution is that of a QR of the same rows.
 */
#include "../unit.h"
#include <incise/factor.h>
#include "../../../lib/base/random.h"
#include "../../../lib/learn/design.h"
#include "../message.h"

#define ROWS 3000

static struct incise_model *premises(void)
{
	const struct incise_variable inputs[] = {{"depth_mm", 0, 20},
						 {"velocity_mm_s", 0, 50}};
	const struct incise_variable output = {"force_N", -0.5, 3};
	const int n_mfs[] = {5, 4};

	return incise_model_new_grid(2, inputs, n_mfs, INCISE_MF_GAUSS, &output, NULL);
}

static void pair(int i, double *row)
{
	uint64_t seed = (uint64_t)i;

	row[0] = 10 + 10 * incise_random_symmetric(&seed);
	row[1] = 25 + 25 * incise_random_symmetric(&seed);
	row[2] = 0.1 * row[0] + sin(row[1] / 9) / 4 +
		 0.05 * incise_random_symmetric(&seed);
}

/* Pairs from … to as a source of that name. */
static void add(struct incise_factor *factor, const char *hash, int from, int to)
{
	char whole[65];

	memset(whole, '0', 64);
	whole[64] = 0;
	memcpy(whole, hash, strlen(hash));
	assert_int_equal(incise_factor_start(factor, whole, "a source", NULL), 0);
	for (int i = from; i < to; i++) {
		double row[3];

		pair(i, row);
		assert_int_equal(incise_factor_add(factor, row, (uint64_t)i / 100, NULL),
				 0);
	}
	incise_factor_add_groups(factor, (uint64_t)(to - from) / 100);
}

static void same(struct incise_factor *a, struct incise_factor *b)
{
	size_t n, m;
	void *p = incise_factor_encode(a, &n), *q = incise_factor_encode(b, &m);

	assert_int_equal(n, m);
	assert_memory_equal(p, q, n);
	free(p);
	free(q);
}

TEST(test_division)
{
	struct incise_model *model = premises();
	struct incise_factor *whole = incise_factor_new(model, NULL), *read;
	struct incise_factor *a = incise_factor_new(model, NULL);
	struct incise_factor *b = incise_factor_new(model, NULL);
	size_t size;
	void *bytes;

	add(whole, "a", 0, 1000);
	add(whole, "b", 1000, ROWS);
	add(b, "b", 1000, ROWS);
	add(a, "a", 0, 1000);
	assert_int_equal(incise_factor_merge(b, a, "a", &err), 0);
	same(whole, b);
	assert_error(incise_factor_merge(b, a, "a.fac", &err), EEXIST, &err, "a.fac");
	same(whole, b);
	bytes = incise_factor_encode(whole, &size);
	read = incise_factor_decode(bytes, size, "whole", &err);
	assert_non_null(read);
	same(whole, read);
	/* Any byte that is altered, and any length, is found. */
	for (size_t at = 0; at < size; at += at < 3000 ? 7 : 977) {
		((char *)bytes)[at] ^= 1;
		assert_null(incise_factor_decode(bytes, size, "altered", &err));
		assert_says(err.text, "altered");
		((char *)bytes)[at] ^= 1;
		assert_null(incise_factor_decode(bytes, at, "short", &err));
	}
	free(bytes);
	incise_factor_free(read);
	incise_factor_free(whole);
	incise_factor_free(a);
	incise_factor_free(b);
	incise_model_free(model);
}

/* Without a ridge, against a QR of the rows: R and the consequents to 1e-10. */
TEST(test_solution)
{
	struct incise_model *model = premises(), *solved;
	struct incise_factor *factor = incise_factor_new(model, NULL);
	struct incise_factor_ridge ridge = {1e-3, 1, NAN};
	struct incise_ridge same_ridge = {1e-3, 1, 60, 20};
	struct incise_train_report report;
	struct incise_lsq *qr = incise_lsq_new(60);
	struct incise_design design;
	double sum = 0, squares = 0, mean, sd, x[60], error = 0, w[20];

	assert_int_equal(incise_design_init(&design, model, -0.5, 3), 0);
	add(factor, "a", 0, ROWS);
	for (int i = 0; i < ROWS; i++) {
		double row[3];

		pair(i, row);
		sum += row[2];
		squares += row[2] * row[2];
	}
	mean = sum / ROWS;
	sd = sqrt(squares / ROWS - mean * mean);
	for (int i = 0; i < ROWS; i++) {
		double row[3], scaled[3];

		pair(i, row);
		incise_scaling_row(&design.scaling, row, scaled);
		incise_basis_firing(&design.basis, scaled, w);
		incise_basis_row(&design.basis, w, scaled, incise_lsq_row(qr));
		incise_lsq_add(qr, (row[2] - mean) / sd);
	}
	assert_int_equal(incise_lsq_solve(qr, &same_ridge, x), 0);
	solved = incise_factor_solve(factor, &ridge, &report, NULL, NULL);
	assert_non_null(solved);
	for (int i = 0; i < ROWS; i++) {
		double row[3], scaled[3], f[20], y;

		pair(i, row);
		incise_scaling_row(&design.scaling, row, scaled);
		incise_basis_firing(&design.basis, scaled, w);
		y = mean + sd * incise_basis_output(&design.basis, w, scaled, x, f);
		assert_true(fabs(y - incise_model_eval(solved, row, NULL)) < 1e-10);
		error += (y - row[2]) * (y - row[2]);
	}
	assert_true(fabs(report.train_rmse - sqrt(error / ROWS)) < 1e-10 * sd);
	incise_model_free(solved);
	incise_model_free(model);
	incise_factor_free(factor);
	incise_lsq_free(qr);
	incise_design_free(&design);
}

TEST(test_hash)
{
	char hex[65];
	FILE *file = fopen("/tmp/incise-test-sha256", "w");

	fputs("abc", file);
	fclose(file);
	assert_int_equal(incise_file_sha256("/tmp/incise-test-sha256", hex, NULL), 0);
	assert_string_equal(
		hex, "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
	remove("/tmp/incise-test-sha256");
	assert_int_equal(incise_file_sha256("/tmp", hex, NULL), -EISDIR);
}
