// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The reader of scenes under libFuzzer. It takes a file or refuses it; numbers of one that it takes
 * are finite and within what incise-scene(5) says.
 *
 * The input is the file.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>
#include <incise/incision.h>
#include <incise/scene.h>

static void wrong(const char *what)
{
	fprintf(stderr, "scene_file: %s\n", what);
	abort();
}

static void check_limits(const struct incise_scene *scene)
{
	double rate_hz = incise_scene_rate_hz(scene);
	struct incise_scene_limits limits;

	incise_scene_limits(scene, &limits);
	if (!(rate_hz >= 100 && rate_hz <= 20000))
		wrong("no rate");
	if (!(limits.force_N >= 0.01 && limits.force_N <= 100 && limits.slew_N_s >= 1 &&
	      limits.slew_N_s <= 1e5 && limits.fade_ms >= 1 && limits.fade_ms <= 1000))
		wrong("no limits");
}

static void check_membrane(const struct incise_scene *scene)
{
	struct incise_scene_membrane m;
	double length2;

	if (!incise_scene_membrane(scene, &m))
		return;
	length2 = m.normal[0] * m.normal[0] + m.normal[1] * m.normal[1] +
		  m.normal[2] * m.normal[2];
	/* A unit vector, but for the rounding of three products. */
	if (!(fabs(length2 - 1) < 1e-12) || !(m.radius_mm > 0) ||
	    !(m.back_wall_mm > m.thickness_mm))
		wrong("no membrane");
}

static void check_criteria(const struct incise_scene *scene)
{
	struct incise_scene_criterion criteria[INCISE_CRITERIA];

	incise_scene_criteria(scene, criteria);
	for (int i = 0; i < INCISE_CRITERIA; i++)
		if (!(criteria[i].min >= 0 && criteria[i].min <= criteria[i].max &&
		      criteria[i].max <= 1e5) ||
		    (!criteria[i].asked && criteria[i].max != 0))
			wrong("no criterion");
}

static void check_rest(const struct incise_scene *scene)
{
	struct incise_scene_scalpel scalpel;
	struct incise_scene_picture picture;
	struct incise_incision *incision;
	uint32_t crc32c;

	incise_scene_scalpel(scene, &scalpel);
	if (!(scalpel.handle_mm >= 1 && scalpel.handle_mm <= 1000) ||
	    !(fabs(scalpel.axis[0]) <= 1))
		wrong("no scalpel");
	incise_scene_picture(scene, &picture);
	if (picture.texture_px < 256 || picture.texture_px > 4096)
		wrong("no picture");
	if (incise_scene_checksum(scene, &crc32c, NULL))
		wrong("no checksum of what was just read");
	incision = incise_incision_new(scene, NULL);
	if (!incision || incise_incision_cuts(incision))
		wrong("no incision");
	incise_incision_free(incision);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	static char path[40];
	static int fd = -1;
	struct incise_error err = {0};
	struct incise_scene *scene;

	if (fd < 0)
		fd = memfd_create("scene", MFD_CLOEXEC);
	snprintf(path, sizeof(path), "/proc/self/fd/%d", fd);
	if (fd < 0 || ftruncate(fd, 0) || pwrite(fd, data, size, 0) != (ssize_t)size)
		wrong("no file");
	scene = incise_scene_load(path, NULL, &err);
	if (!scene && (!err.code || !*err.text || strchr(err.text, '\n')))
		wrong("refused without a reason in one line");
	if (!scene)
		return 0;
	check_limits(scene);
	check_membrane(scene);
	check_criteria(scene);
	check_rest(scene);
	incise_scene_free(scene);
	return 0;
}
