// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Training from very many pairs, made on the fly: time of a pair, memory, and the growth of both.
 *
 *     corpus PAIRS [ROWS.bin MODEL.fis]
 *
 * Prints nanoseconds a pair of the survey (a random number and the sample), of the sums at 5×4
 * Gaussians, and of making the pair; and the largest memory. With two files it writes the pairs as
 * doubles (depth, velocity, force) and the model without a ridge, for corpus.py.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/resource.h>
#include <time.h>
#include "../../lib/base/random.h"
#include "../../lib/learn/corpus.h"

struct stream {
	uint64_t pairs;
	FILE *copy;
};

static double now(void)
{
	struct timespec t;

	clock_gettime(CLOCK_MONOTONIC, &t);
	return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void make(uint64_t i, double *row)
{
	uint64_t bits = incise_random_bits(1, i);
	double d = (double)(bits >> 44) * 0x1p-20 * 20;
	double v = (double)(bits >> 24 & 0xfffff) * 0x1p-20 * 50;

	row[0] = d;
	row[1] = v;
	row[2] = (0.045 * d + 0.0028 * d * d) * (1 + 0.35 * v / (v + 15)) +
		 0.05 * ((double)(bits & 0xffffff) * 0x1p-24 - 0.5);
}

static int each(void *user, incise_row_taker take, void *taker, struct incise_error *err)
{
	struct stream *stream = user;
	double row[3];
	int rc = 0;

	for (uint64_t i = 0; i < stream->pairs && !rc; i++) {
		make(i, row);
		if (stream->copy)
			fwrite(row, sizeof(row), 1, stream->copy);
		rc = take(taker, row, NULL, err);
	}
	return rc;
}

static int nothing(void *user, const double *row, const char *group,
		   struct incise_error *err)
{
	(void)group;
	(void)err;
	*(double *)user += row[2];
	return 0;
}

int main(int argc, char **argv)
{
	const struct incise_variable inputs[] = {{"depth_mm", 0, 20},
						 {"velocity_mm_s", 0, 50}};
	const struct incise_variable output = {"force_N", -0.1, 3.5};
	const struct incise_factor_ridge none = {0, 0};
	struct stream stream = {argc > 1 ? strtoull(argv[1], NULL, 10) : 1000000, NULL};
	char hash[] = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
	const struct incise_corpus_source source = {.name = "made",
						    .hash = hash,
						    .text = "made",
						    .group = "",
						    .read = each,
						    .user = &stream};
	struct incise_corpus *corpus =
		incise_corpus_new(2, false, 1, INCISE_CORPUS_SAMPLE);
	const int n_mfs[] = {5, 4};
	struct incise_model *premises =
		incise_model_new_grid(2, inputs, n_mfs, INCISE_MF_GAUSS, &output, NULL);
	struct incise_factor *factor = incise_factor_new(premises, NULL);
	struct incise_error err = {0};
	struct incise_train_report report;
	struct incise_model *model;
	struct rusage usage;
	double t[5], sum = 0;

	t[0] = now();
	each(&stream, nothing, &sum, &err);
	t[1] = now();
	if (incise_corpus_survey(corpus, &source, &err) ||
	    incise_corpus_settle(corpus, 0, &err))
		goto failed;
	t[2] = now();
	stream.copy = argc > 3 ? fopen(argv[2], "w") : NULL;
	if (incise_corpus_fold(corpus, &source, factor, NULL, &err))
		goto failed;
	t[3] = now();
	if (stream.copy)
		fclose(stream.copy);
	model = incise_factor_solve(factor, &none, &report, NULL, NULL, &err);
	if (!model || (argc > 3 && incise_model_save(model, argv[3], &err)))
		goto failed;
	t[4] = now();
	getrusage(RUSAGE_SELF, &usage);
	printf("%llu pairs: made %.1f ns, surveyed %.1f ns, added %.1f ns a pair; solved in "
	       "%.3f s; RMSE %.6f; %ld MiB\n",
	       (unsigned long long)stream.pairs,
	       1e9 * (t[1] - t[0]) / (double)stream.pairs,
	       1e9 * (t[2] - t[1]) / (double)stream.pairs,
	       1e9 * (t[3] - t[2]) / (double)stream.pairs, t[4] - t[3], report.train_rmse,
	       usage.ru_maxrss / 1024);
	incise_model_free(model);
	incise_model_free(premises);
	incise_factor_free(factor);
	incise_corpus_free(corpus);
	return 0;
failed:
	fprintf(stderr, "corpus: %s\n", err.text);
	return 1;
}
