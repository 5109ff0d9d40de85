// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Cost of writing frames: CPU of all threads per frame, the longest put(), bytes per hour at
 * 60 Hz. The frames are those of the virtual camera, in each format; MJPEG is 42 kB of noise,
 * the size that a VGA camera sends, and is written unchanged.
 *
 *     frames FOLDER [PICTURES [THREADS [SYNC_MS]]]
 */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>
#include <incise/rig.h>
#include "../../lib/record/frames.h"

#define WIDTH 640
#define HEIGHT 480
#define HZ 60
#define JPEG_BYTES 42000
#define SHOTS 16 /* different pictures, over and over */

static double seconds(clockid_t clock)
{
	struct timespec now;

	clock_gettime(clock, &now);
	return (double)now.tv_sec + now.tv_nsec * 1e-9;
}

/* BT.601, near enough for what the encoder meets. */
static void convert(enum incise_pixels pixels, const uint8_t *rgb, uint8_t *to)
{
	for (int i = 0; i < WIDTH * HEIGHT; i += 2, rgb += 6) {
		int y[2], u, v;

		for (int k = 0; k < 2; k++)
			y[k] = (77 * rgb[3 * k] + 150 * rgb[3 * k + 1] +
				29 * rgb[3 * k + 2]) >>
			       8;
		u = 128 + (rgb[2] + rgb[5] - y[0] - y[1]) / 4;
		v = 128 + (rgb[0] + rgb[3] - y[0] - y[1]) / 3;
		if (pixels == INCISE_PIXELS_GREY) {
			to[i] = (uint8_t)y[0];
			to[i + 1] = (uint8_t)y[1];
			continue;
		}
		to[2 * i] = (uint8_t)y[0];
		to[2 * i + 1] = (uint8_t)u;
		to[2 * i + 2] = (uint8_t)y[1];
		to[2 * i + 3] = (uint8_t)(v > 255 ? 255 : v);
	}
}

/* Pictures 50 ms apart, while the virtual surgeon cuts. */
static uint8_t *shoot(enum incise_pixels pixels, size_t size)
{
	struct incise_rig *rig =
		incise_rig_open("sim:clock=simulated", INCISE_RIG_CAMERA, NULL);
	struct incise_camera_frame frame;
	uint8_t *shots = malloc(SHOTS * size);

	if (!rig || !shots)
		exit(1);
	for (int i = 0; i < SHOTS; i++) {
		struct incise_clock *clock = incise_rig_clock(rig);

		incise_clock_wait_until(clock, incise_clock_now(clock) +
						       (i ? 50000000LL : 3000000000LL));
		if (incise_camera_newest(incise_rig_camera(rig), &frame) != 1)
			exit(1);
		if (pixels == INCISE_PIXELS_RGB)
			memcpy(shots + size * i, frame.data, size);
		else if (pixels == INCISE_PIXELS_MJPEG)
			for (size_t k = 0; k < size; k++)
				shots[size * i + k] = (uint8_t)random();
		else
			convert(pixels, frame.data, shots + size * i);
	}
	incise_rig_close(rig);
	return shots;
}

int main(int argc, char **argv)
{
	static const char *const names[] = {"RGB", "grey", "YUYV", "MJPEG"};
	int pictures = argc > 2 ? atoi(argv[2]) : 600;
	struct incise_frames_options options = {
		.threads = argc > 3 ? atoi(argv[3]) : 1,
		.sync_ns = argc > 4 ? atoll(argv[4]) * 1000000 : 0,
	};

	if (argc < 2 || pictures < 1)
		return 2;
	printf("pixels  CPU_ms  of_one_core_%%  wall_ms  longest_ms  kB  GB_h\n");
	for (int f = INCISE_PIXELS_RGB; f <= INCISE_PIXELS_MJPEG; f++) {
		struct incise_frames_shape shape = {WIDTH, HEIGHT, (enum incise_pixels)f,
						    HZ};
		size_t row = incise_frames_row(shape.pixels, WIDTH);
		size_t size = row ? row * HEIGHT : JPEG_BYTES;
		uint8_t *shots = shoot(shape.pixels, size);
		struct incise_error err = {0};
		struct incise_frames_writer *writer;
		double cpu, wall, longest = 0, bytes = 0;
		char path[4096];

		snprintf(path, sizeof(path), "%s/bench-%s.mkv", argv[1], names[f]);
		unlink(path);
		writer = incise_frames.create(path, &shape, &options, &err);
		cpu = seconds(CLOCK_PROCESS_CPUTIME_ID);
		wall = seconds(CLOCK_MONOTONIC);
		for (int i = 0; writer && i < pictures; i++) {
			struct incise_camera_frame frame = {
				.t_ns = (int64_t)i * 16666667,
				.seq = (uint64_t)i,
				.width = WIDTH,
				.height = HEIGHT,
				.stride = (int)row,
				.pixels = shape.pixels,
				.data = shots + size * (i % SHOTS),
				.size = size,
			};
			struct incise_frames_stored stored;
			double begun = seconds(CLOCK_MONOTONIC), took;

			if (writer->ops->put(writer, &frame, &stored, &err))
				break;
			bytes += stored.bytes;
			took = seconds(CLOCK_MONOTONIC) - begun;
			longest = took > longest ? took : longest;
		}
		cpu = seconds(CLOCK_PROCESS_CPUTIME_ID) - cpu;
		wall = seconds(CLOCK_MONOTONIC) - wall;
		if (!writer || err.code || writer->ops->close(writer, &err)) {
			fprintf(stderr, "%s\n", err.text);
			return 1;
		}
		printf("%-6s  %6.2f  %13.1f  %7.2f  %10.1f  %.1f  %.1f\n", names[f],
		       1e3 * cpu / pictures, 1e2 * cpu / pictures * HZ,
		       1e3 * wall / pictures, 1e3 * longest, bytes / pictures / 1e3,
		       bytes / pictures * HZ * 3600 / 1e9);
		unlink(path);
		free(shots);
	}
	return 0;
}
