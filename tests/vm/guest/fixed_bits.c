// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The integer model in a program, for the same in the kernel to be compared with:
 *
 *   fixed_bits MODEL.fis N DIR    compiles the model for each arithmetic into DIR and prints
 *                                 the parameters of incise_kunit.ko: the file, N random
 *                                 inputs, see driver/kunit/trial.h, and the CRC-32C of results
 */
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <incise/fixed.h>
#include <incise/model.h>

#include "../../../lib/fixed/layout.h"
#include "../../../driver/kunit/trial.h"

/* As driver/kunit/fixed.c: output and force of each input. */
static uint32_t digest(const struct incise_fixed *fx, uint32_t n, uint64_t state)
{
	static struct incise_fx_trial_cut cut;
	int32_t(*result)[4] = calloc(n, sizeof(*result));
	uint32_t crc;

	if (!result)
		exit(1);
	for (uint32_t i = 0; i < n; i++) {
		int32_t x[INCISE_FIXED_INPUTS_MAX];

		incise_fx_trial_inputs(&state, fx, x);
		result[i][0] = incise_fixed_eval(fx, x);
		incise_fx_trial_force(&state, &cut, &result[i][1]);
	}
	crc = incise_fx_crc((const uint8_t *)result, n * (uint32_t)sizeof(*result));
	free(result);
	return crc;
}

static bool write_blob(const struct incise_fixed *fx, const char *path)
{
	FILE *file = fopen(path, "w");
	bool good = file && fwrite(fx->blob, fx->size, 1, file) == 1;

	if (file)
		good = !fclose(file) && good;
	return good;
}

int main(int argc, char **argv)
{
	struct incise_error err = {0};
	struct incise_model *model;

	if (argc != 4)
		return 2;
	model = incise_model_load(argv[1], &err);
	for (int arithmetic = 0; model && arithmetic < 3; arithmetic++) {
		struct incise_fixed_options options;
		struct incise_fixed *fx;
		char path[256];
		uint32_t n = (uint32_t)atoi(argv[2]);

		incise_fixed_options_init(&options);
		options.arithmetic = arithmetic;
		options.budget = 0; /* bits are the matter here */
		fx = incise_fixed_compile(model, &options, &err);
		snprintf(path, sizeof(path), "%s/%s.fx", argv[3],
			 incise_fixed_arithmetic_name(arithmetic));
		if (!fx || !write_blob(fx, path))
			break;
		printf("blob=%s count=%u seed=%d digest=%#x\n", path, n, 1 + arithmetic,
		       digest(fx, n, 1 + (uint64_t)arithmetic));
		incise_fixed_free(fx);
	}
	incise_model_free(model);
	if (err.text[0])
		fprintf(stderr, "%s\n", err.text);
	return err.text[0] != 0;
}
