// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A standard deviation (.sd): refused with a reason, or finite at any inputs, and
 * written again it gives the same values.
 */
#include <fcntl.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>
#include <incise/uncertainty.h>

/* Two rules of one input: four unknowns. */
static struct incise_model *make_model(void)
{
	const struct incise_variable input = {"depth_mm", 0, 10},
				     output = {"force_N", 0, 1};
	const int n_mfs[] = {2};

	return incise_model_new_grid(1, &input, n_mfs, INCISE_MF_GAUSS, &output, NULL);
}

static struct incise_uncertainty *load(const void *data, size_t size,
				       const struct incise_model *model)
{
	int fd = memfd_create("sd", MFD_CLOEXEC);
	struct incise_uncertainty *u;
	struct incise_error err = {0};
	char path[40];

	if (fd < 0 || write(fd, data, size) != (ssize_t)size)
		abort();
	snprintf(path, sizeof(path), "/proc/self/fd/%d", fd);
	u = incise_uncertainty_load(path, model, &err);
	if (!u && (!err.code || !*err.text))
		abort();
	close(fd);
	return u;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	static struct incise_model *model;
	struct incise_uncertainty *u, *again;

	if (!model)
		model = make_model();
	u = load(data, size, model);
	if (u) {
		char path[] = "/tmp/incise-fuzz-sd-XXXXXX", text[1 << 14];
		int fd = mkstemp(path);
		ssize_t n;

		if (fd < 0 || incise_uncertainty_save(u, path, NULL))
			abort();
		close(fd);
		fd = open(path, O_RDONLY | O_CLOEXEC);
		n = read(fd, text, sizeof(text));
		close(fd);
		unlink(path);
		again = load(text, (size_t)n, model);
		for (double x = -5; again && x < 20; x += 2.5) {
			struct incise_uncertainty_parts a, b;

			incise_uncertainty_parts(u, model, &x, &a);
			incise_uncertainty_parts(again, model, &x, &b);
			if (!isfinite(a.total) || !isfinite(a.calibration) ||
			    !isfinite(a.rig) || memcmp(&a, &b, sizeof(a)))
				abort();
		}
		if (!again)
			abort();
		incise_uncertainty_free(again);
	}
	incise_uncertainty_free(u);
	return 0;
}
