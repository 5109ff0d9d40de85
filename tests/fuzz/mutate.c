// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Fuzz targets without libFuzzer, for `make check`: the inputs in tests/fuzz/NAME/, then seeded changes
 * of them, the same ones each time. A symbolic link NAME to this program runs fuzz_NAME(), which is
 * LLVMFuzzerTestOneInput() of tests/fuzz/NAME.c. FUZZ_RUNS=N, SEED=N; an input that fails is left in
 * /tmp/fuzz-NAME.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <dirent.h>
#include <dlfcn.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "../../lib/base/random.h"
#include "../unit/cases.h"

#define SIZE_MAX_BYTES 4096
#define INPUTS_MAX 1024

/* Of the sanitizers; plain builds have none. */
void __sanitizer_set_death_callback(void (*callback)(void)) __attribute__((weak));

static struct input {
	size_t size;
	uint8_t *bytes;
} inputs[INPUTS_MAX], tried;
static int n_inputs;
static const char *target;
static uint64_t state;

static void save_input(void)
{
	char path[300];
	FILE *file;

	if (!tried.bytes)
		return;
	snprintf(path, sizeof(path), "/tmp/fuzz-%s", target);
	file = fopen(path, "w");
	if (file && fwrite(tried.bytes, 1, tried.size, file) == tried.size)
		fprintf(stderr,
			"the input is in %s: once mended, keep it in tests/fuzz/%s/\n",
			path, target);
	if (file)
		fclose(file);
}

static void save_and_end(int number)
{
	save_input();
	signal(number, SIG_DFL);
	raise(number);
}

static size_t draw(size_t n)
{
	incise_random_step(&state);
	return n ? (state >> 16) % n : 0;
}

static int compare(const void *a, const void *b)
{
	return strcmp(*(char *const *)a, *(char *const *)b);
}

/* In the order of their names, so that a seed gives the same cases on each machine. */
static void read_inputs(void)
{
	char folder[256], path[512], *names[INPUTS_MAX];
	struct dirent *entry;
	int n_names = 0;
	FILE *file;
	DIR *dir;

	snprintf(folder, sizeof(folder), "tests/fuzz/%s", target);
	dir = opendir(folder);
	while (dir && (entry = readdir(dir)))
		if (*entry->d_name != '.') {
			assert_true(n_names < INPUTS_MAX);
			names[n_names++] = strdup(entry->d_name);
		}
	if (dir)
		closedir(dir);
	qsort(names, (size_t)n_names, sizeof(*names), compare);
	for (int i = 0; i < n_names; i++) {
		struct input *input = &inputs[n_inputs++];

		snprintf(path, sizeof(path), "%s/%s", folder, names[i]);
		free(names[i]);
		file = fopen(path, "r");
		assert_non_null(file);
		input->bytes = malloc(1 << 20);
		input->size = fread(input->bytes, 1, 1 << 20, file);
		assert_true(feof(file));
		fclose(file);
	}
}

/* Make room for @n bytes at @at, or remove as many; what does not fit falls off the end. */
static void shift(size_t at, size_t n, int remove)
{
	if (remove) {
		memmove(tried.bytes + at, tried.bytes + at + n, tried.size - at - n);
		tried.size -= n;
		return;
	}
	if (n > SIZE_MAX_BYTES - at)
		n = SIZE_MAX_BYTES - at;
	if (tried.size > SIZE_MAX_BYTES - n)
		tried.size = SIZE_MAX_BYTES - n;
	if (tried.size > at)
		memmove(tried.bytes + at + n, tried.bytes + at, tried.size - at);
	tried.size += n;
	for (size_t i = 0; i < n; i++)
		tried.bytes[at + i] = (uint8_t)draw(256);
}

static void change_input(void)
{
	static const uint8_t edges[] = {0,   1,	  0x7f, 0x80, 0xff, '0',
					'9', '-', '.',	'e',  '\n', ' '};
	size_t at = draw(tried.size), left = tried.size - at,
	       n = draw(left < 64 ? left : 64);
	const struct input *other = &inputs[draw((size_t)n_inputs)];

	switch (draw(7)) {
	case 0:
		if (left)
			tried.bytes[at] ^= (uint8_t)(1u << draw(8));
		break;
	case 1:
		if (left)
			tried.bytes[at] = edges[draw(sizeof(edges))];
		break;
	case 2:
		shift(at, n, 1);
		break;
	case 3:
		shift(at, 1 + draw(16), 0);
		break;
	case 4: /* a piece again, elsewhere */
		memmove(tried.bytes + draw(tried.size - n + 1), tried.bytes + at, n);
		break;
	case 5: /* the rest of another one */
		if (other->size > at && other->size <= SIZE_MAX_BYTES) {
			memcpy(tried.bytes + at, other->bytes + at, other->size - at);
			tried.size = other->size;
		}
		break;
	default:
		tried.size = draw(8) ? tried.size : at;
	}
}

static void test_target(void **unused)
{
	const char *text = getenv("FUZZ_RUNS");
	long runs = text ? atol(text) : 6000;
	int (*run)(const uint8_t *data, size_t size);
	char symbol[256];

	(void)unused;
	snprintf(symbol, sizeof(symbol), "fuzz_%s", target);
	run = (int (*)(const uint8_t *, size_t))dlsym(RTLD_DEFAULT, symbol);
	assert_non_null(run);
	state = cases_seed(1) | 1;
	read_inputs();
	for (int i = 0; i < n_inputs; i++) {
		tried = inputs[i];
		run(tried.bytes, tried.size);
	}
	for (; runs; runs--) {
		const struct input *from = &inputs[draw((size_t)n_inputs)];
		uint8_t *copy;

		tried.bytes = calloc(1, SIZE_MAX_BYTES);
		tried.size = from->size < SIZE_MAX_BYTES ? from->size : SIZE_MAX_BYTES;
		if (tried.size)
			memcpy(tried.bytes, from->bytes, tried.size);
		for (size_t changes = 1 + draw(5); changes; changes--)
			change_input();
		/* Its own size, so that a sanitizer sees an access behind it. */
		copy = realloc(tried.bytes, tried.size ? tried.size : 1);
		tried.bytes = copy;
		run(tried.bytes, tried.size);
		free(copy);
	}
	tried = (struct input){0};
	for (int i = 0; i < n_inputs; i++)
		free(inputs[i].bytes);
}

int main(int argc, char **argv)
{
	const char *slash = strrchr(argv[0], '/');
	const struct CMUnitTest tests[] = {cmocka_unit_test(test_target)};

	target = slash ? slash + 1 : argv[0];
	if (argc > 1)
		return 2;
	signal(SIGABRT, save_and_end);
	if (__sanitizer_set_death_callback)
		__sanitizer_set_death_callback(save_input);
	return cmocka_run_group_tests(tests, NULL, NULL);
}
