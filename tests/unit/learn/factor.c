// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Factors: any division of the pairs gives the same bytes, a file is read as it was written, no
 * part of it has so few pairs or groups that it gives them away, and the solution is that of a QR
 * of the same rows.
 */
#include "../unit.h"
#include "../../../lib/learn/factor.h"
#include "../../../lib/base/random.h"
#include "../../../lib/learn/design.h"
#include "../cases.h"

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
		assert_int_equal(
			incise_factor_add(factor, row, (uint64_t)i / 100, 1, NULL), 0);
	}
	for (int g = from / 100; g < to / 100; g++)
		incise_factor_count(factor, (uint64_t)g, 1, 100);
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

#define FILE_FAC "/tmp/incise-test-factor.fac"

/* Groups of a fold, of that many pairs each, counted as so many different ones. */
static void add_groups(struct incise_factor *factor, uint64_t fold, int groups, int pairs,
		       int different)
{
	for (int g = 0; g < groups; g++) {
		uint64_t key = fold + 5 * (uint64_t)g;

		for (int i = 0; i < pairs; i++) {
			double row[3];

			pair(1000 * g + i, row);
			assert_int_equal(incise_factor_add(factor, row, key, 1, NULL), 0);
		}
		incise_factor_count(factor, key, 1, (uint64_t)different);
	}
}

/* Parts of the file have the pairs and groups of their folds, and none is small. */
static int check_parts(const uint64_t *n, const uint64_t *groups, uint64_t least)
{
	unsigned long long folds, pairs, different, found;
	unsigned int f = 0, parts = 0;
	FILE *file = fopen(FILE_FAC, "r");
	char line[1200];

	while (f < 5 && fgets(line, sizeof(line), file)) {
		uint64_t own = 0, own_groups = 0;

		if (sscanf(line, "part %llu %llu %llu %llu", &folds, &pairs, &different,
			   &found) != 4)
			continue;
		for (unsigned int end = f + (unsigned int)folds; f < end && f < 5; f++) {
			own += n[f];
			own_groups += groups[f];
		}
		parts++;
		assert_int_equal(pairs, own);
		assert_int_equal(different, own < least ? own : least);
		assert_int_equal(found, own_groups);
		assert_true(!pairs || (pairs >= least && found >= 5));
	}
	assert_int_equal(f, 5);
	fclose(file);
	return (int)parts;
}

/* Shares of any size and any number of cuts: refused, or no part below the bound. */
TEST(test_no_part_is_small)
{
	static const int mfs[] = {2, 3, 4, 5};
	const struct incise_variable inputs[] = {{"depth_mm", 0, 20},
						 {"velocity_mm_s", 0, 50}};
	const struct incise_variable output = {"force_N", -0.5, 3};
	uint64_t seed = cases_seed(41);
	int refused = 0, joined = 0, whole = 0;

	for (int c = 0; c < cases_of(400, 40); c++) {
		const int n_mfs[] = {mfs[c % 4], mfs[c % 4]};
		struct incise_model *model = incise_model_new_grid(
			2, inputs, n_mfs, INCISE_MF_GAUSS, &output, NULL);
		struct incise_factor *factor = incise_factor_new(model, NULL), *read;
		uint64_t elements = 3 * (uint64_t)(n_mfs[0] * n_mfs[1]) + 2,
			 least = elements * (elements + 1) / 2, n[5] = {0},
			 groups[5] = {0}, sum = 0, n_groups = 0;
		int most = c % 3 ? 900 : 60;
		char hash[65];

		least = least > 1000 ? least : 1000;
		snprintf(hash, sizeof(hash), "%064d", c);
		assert_int_equal(incise_factor_start(factor, hash, "a source", NULL), 0);
		for (uint64_t fold = 0; fold < 5; fold++) {
			double u = incise_random_uniform(seed + (uint64_t)c, fold);
			double v = incise_random_uniform(seed + (uint64_t)c, fold + 5);

			groups[fold] = (uint64_t)(c % 2 ? 4 + u * 12 : u * 4);
			add_groups(factor, fold, (int)groups[fold], (int)(v * most),
				   (int)(v * most));
			n[fold] = groups[fold] * (uint64_t)(v * most);
			sum += n[fold];
			n_groups += groups[fold];
		}
		if (sum < least || n_groups < 5) {
			assert_error(incise_factor_save(factor, FILE_FAC, &err), ENODATA,
				     &err, FILE_FAC, "would be revealed");
			assert_int_equal(access(FILE_FAC, F_OK), -1);
			refused++;
		} else {
			int parts;

			assert_int_equal(incise_factor_save(factor, FILE_FAC, &err), 0);
			parts = check_parts(n, groups, least);
			joined += parts < 5;
			whole += parts == 5;
			read = incise_factor_load(FILE_FAC, &err);
			assert_non_null(read);
			same(factor, read);
			incise_factor_free(read);
			remove(FILE_FAC);
		}
		incise_factor_free(factor);
		incise_model_free(model);
	}
	assert_true(refused && joined && whole);
}

/* Joined parts stay so in a merge, in any order, and it has the sums of all pairs. */
TEST(test_merge_of_joined_parts)
{
	struct incise_model *model = premises();
	struct incise_factor *share[3], *all[2];
	struct incise_factor_info info;

	for (int i = 0; i < 3; i++) {
		char hash[65];

		share[i] = incise_factor_new(model, NULL);
		snprintf(hash, sizeof(hash), "%064d", i);
		assert_int_equal(incise_factor_start(share[i], hash, "a", NULL), 0);
		for (uint64_t fold = 0; fold < 5; fold++)
			add_groups(share[i], fold, fold == (uint64_t)i ? 1 : 8, 300, 300);
		assert_int_equal(incise_factor_save(share[i], FILE_FAC, &err), 0);
		incise_factor_info(share[i], &info);
		assert_int_equal(info.parts, 4);
	}
	for (int way = 0; way < 2; way++) {
		all[way] = incise_factor_new(model, NULL);
		for (int i = 0; i < 3; i++)
			assert_int_equal(incise_factor_merge(all[way],
							     share[way ? 2 - i : i], "",
							     &err),
					 0);
		assert_int_equal(incise_factor_save(all[way], FILE_FAC, &err), 0);
	}
	same(all[0], all[1]);
	incise_factor_info(all[0], &info);
	assert_int_equal(info.parts, 2);
	assert_int_equal(info.rows, 3 * 33 * 300);
	assert_int_equal(info.groups, 3 * 33);
	for (int i = 0; i < 3; i++)
		incise_factor_free(share[i]);
	incise_factor_free(all[0]);
	incise_factor_free(all[1]);
	incise_model_free(model);
	remove(FILE_FAC);
}

/* A file that was made otherwise is read only if its parts are as large. */
TEST(test_small_part_in_a_file)
{
	static const struct {
		int groups, pairs, different;
		bool read;
	} parts[] = {{5, 4, 4, false},
		     {4, 600, 600, false},
		     {5, 400, 380, false},
		     {5, 400, 400, true}};
	struct incise_model *model = premises();

	for (size_t i = 0; i < sizeof(parts) / sizeof(*parts); i++) {
		struct incise_factor *factor = incise_factor_new(model, NULL), *read;
		char hash[65];
		size_t size;
		void *bytes;
		FILE *file;

		snprintf(hash, sizeof(hash), "%064d", 1);
		assert_int_equal(incise_factor_start(factor, hash, "a", NULL), 0);
		for (uint64_t fold = 0; fold < 4; fold++)
			add_groups(factor, fold, 8, 300, 300);
		add_groups(factor, 4, parts[i].groups, parts[i].pairs,
			   parts[i].different);
		bytes = incise_factor_encode(factor, &size);
		file = fopen(FILE_FAC, "w");
		assert_int_equal(fwrite(bytes, 1, size, file), size);
		fclose(file);
		if (parts[i].read) {
			read = incise_factor_load(FILE_FAC, &err);
			assert_non_null(read);
			incise_factor_free(read);
		} else {
			assert_error(incise_factor_load(FILE_FAC, &err), EINVAL, &err,
				     FILE_FAC, "reveals its pairs");
		}
		incise_factor_free(factor);
		free(bytes);
	}
	incise_model_free(model);
	remove(FILE_FAC);
}

/* Without a ridge, against a QR of the rows: R and the consequents to 1e-10. */
TEST(test_solution)
{
	struct incise_model *model = premises(), *solved;
	struct incise_factor *factor = incise_factor_new(model, NULL);
	struct incise_factor_ridge ridge = {1e-3, NAN};
	struct incise_ridge same_ridge = {.ridge = 1e-3, .n = 60};
	struct incise_train_report report;
	struct incise_lsq *qr = incise_lsq_new(60, NULL);
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
	solved = incise_factor_solve(factor, &ridge, &report, NULL, NULL, NULL);
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
