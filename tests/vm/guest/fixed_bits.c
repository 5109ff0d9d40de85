// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The integer model in the kernel against the same in a program, to the bit:
 *
 *   fixed_bits MODEL.fis N        N inputs by chance for each arithmetic, see
 *                                 lib/fixed/trial.h
 */
#include <errno.h>
#include <fcntl.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <incise/fixed.h>
#include <incise/model.h>

#include "../../../lib/fixed/trial.h"

#define DIR "/sys/kernel/debug/incise_stepper/fixed/"

static void report(bool good, const char *what, const char *of)
{
	printf("%sok %s%s\n", good ? "" : "not ", what, of);
}

static bool put(const char *path, const void *bytes, size_t n)
{
	int fd = open(path, O_WRONLY | O_CLOEXEC);
	bool good = fd >= 0 && write(fd, bytes, n) == (ssize_t)n;

	if (fd >= 0)
		close(fd);
	return good;
}

/* Exactly n bytes, and then the end. */
static bool get(const char *path, void *bytes, size_t n)
{
	int fd = open(path, O_RDONLY | O_CLOEXEC);
	size_t done = 0;
	ssize_t got = 1;
	char more;

	while (fd >= 0 && got > 0 && done < n) {
		got = read(fd, (char *)bytes + done, n - done);
		done += got > 0 ? (size_t)got : 0;
	}
	got = fd >= 0 ? read(fd, &more, 1) : -1;
	if (fd >= 0)
		close(fd);
	return done == n && got == 0;
}

static void try_blob(const struct incise_fixed *fx, uint32_t n, uint64_t seed)
{
	const char *name = incise_fixed_arithmetic_name(fx->arithmetic);
	int32_t *outputs = calloc(n, sizeof(*outputs));
	int32_t *forces = calloc(n, 4 * sizeof(*forces));
	uint32_t wrong = 0, held = 0;
	uint64_t state = seed;
	char run[64];

	if (!outputs || !forces)
		exit(1);
	snprintf(run, sizeof(run), "%u %llu", n, (unsigned long long)seed);
	report(put(DIR "blob", fx->blob, fx->size) && put(DIR "run", run, strlen(run)),
	       "the kernel takes a blob: ", name);
	report(get(DIR "outputs", outputs, n * sizeof(*outputs)) &&
		       get(DIR "forces", forces, n * 4 * sizeof(*forces)),
	       "and gives as many results: ", name);
	for (uint32_t i = 0; i < n; i++) {
		struct incise_fixed_spring spring;
		int32_t x[INCISE_FIXED_INPUTS_MAX], p[3], force[4] = {0};

		incise_fx_trial_inputs(&state, fx, x);
		wrong += outputs[i] != incise_fixed_eval(fx, x);
		incise_fx_trial_spring(&state, &spring, p);
		force[3] = incise_fixed_spring_pull(&spring, p, force);
		wrong += memcmp(force, &forces[4 * i], sizeof(force)) != 0;
		held += force[3] == INT32_MAX || force[3] == -INT32_MAX;
	}
	report(!wrong, "every bit is the same: ", name);
	printf("# %u inputs, %u springs at the end of their range\n", n, held);
	free(outputs);
	free(forces);
}

/* A blob with one bit changed anywhere is no blob. */
static void try_damage(const struct incise_fixed *fx)
{
	unsigned char *bytes = malloc(fx->size);
	unsigned int taken = 0;

	if (!bytes)
		exit(1);
	memcpy(bytes, fx->blob, fx->size);
	for (uint32_t i = 0; i < 200; i++) {
		uint32_t at = (uint32_t)((uint64_t)fx->size * i / 200);

		bytes[at] ^= 1 << i % 8;
		put(DIR "blob", bytes, fx->size);
		taken += put(DIR "run", "1 1", 3);
		bytes[at] ^= 1 << i % 8;
	}
	report(!taken, "a damaged blob is refused", "");
	free(bytes);
}

int main(int argc, char **argv)
{
	struct incise_error err = {0};
	struct incise_model *model;

	if (argc != 3)
		return 2;
	model = incise_model_load(argv[1], &err);
	for (int arithmetic = 0; model && arithmetic < 3; arithmetic++) {
		struct incise_fixed_options options;
		struct incise_fixed *fx;

		incise_fixed_options_init(&options);
		options.arithmetic = arithmetic;
		options.budget = 0; /* bits are the matter here */
		fx = incise_fixed_compile(model, &options, &err);
		if (!fx)
			break;
		try_blob(fx, (uint32_t)atoi(argv[2]), 1 + (uint64_t)arithmetic);
		if (arithmetic == 0)
			try_damage(fx);
		incise_fixed_free(fx);
	}
	report(!err.text[0], "model and blobs ", err.text);
	incise_model_free(model);
	return 0;
}
