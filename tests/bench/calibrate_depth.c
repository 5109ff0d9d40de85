// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Whether the stated intervals of incise calibrate depth hold the truth: 200 virtual rigs,
 * each with a camera of another scale, whose pictures are measured by vision.
 *
 *     two-point   10 pictures in the air; the known length is off by its own uncertainty
 *     line        some 140 pictures in the tissue, from all depths; beside them a dial gauge of
 *                 0.01 mm, whose scale is off by its own uncertainty, too
 *
 * Fails unless 92 to 98 % hold and each is within 0.1 %.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/calibrate_depth.h>
#include <incise/rig.h>
#include <incise/vision.h>
#include "../../lib/base/random.h"
#include "../../lib/sim/sim.h"

#define RIGS 200
#define IN_AIR 10
#define IN_TISSUE 300
#define LENGTH_MM 47.5
#define U_LENGTH_MM 0.012
#define U_VISION_PX 0.03
#define U_GAUGE 0.0002
#define GAUGE_MM 0.01

static uint64_t state;

static double uniform(void)
{
	return ((incise_random_mix(state += 0x9e3779b97f4a7c15u) >> 11) + 0.5) * 0x1p-53;
}

static double normal(void)
{
	return sqrt(-2 * log(uniform())) * cos(2 * M_PI * uniform());
}

_Noreturn static void fail(const struct incise_error *err)
{
	fprintf(stderr, "%s\n", err->text);
	exit(1);
}

struct seen {
	double px[IN_TISSUE], mm[IN_TISSUE];
	int n;
};

/* Look each 0.2 s, to the end of the script. */
static void look(struct incise_rig *rig, struct incise_vision *vision, struct seen *air,
		 struct seen *tissue)
{
	struct incise_clock *clock = incise_rig_clock(rig);
	int64_t end = incise_clock_now(clock) + incise_sim_duration(incise_rig_sim(rig));

	while (incise_clock_now(clock) < end) {
		struct incise_camera_frame frame;
		struct incise_vision_result result;
		struct incise_sim_truth truth;
		struct seen *seen;

		/* Pictures are of whole 0.02 s: the truth is asked for at that time. */
		if (incise_clock_wait_until(clock, incise_clock_now(clock) + 200000000))
			exit(1);
		incise_sim_truth(incise_rig_sim(rig), &truth);
		if (incise_camera_newest(incise_rig_camera(rig), &frame) != 1)
			continue;
		seen = truth.depth_mm > 0.5 ? tissue : air;
		if (seen->n == (seen == air ? IN_AIR : IN_TISSUE) ||
		    truth.t_ns != frame.t_ns || (seen == air && truth.depth_mm > 0))
			continue;
		if (incise_vision_measure(vision, &frame, &result) || !result.found)
			continue;
		seen->px[seen->n] = result.length_px;
		seen->mm[seen->n++] = truth.depth_mm;
	}
}

int main(void)
{
	int held[2] = {0}, held_full = 0;
	double worst[2] = {0}, off[2] = {0};
	bool good = true;

	for (int n = 1; n <= RIGS; n++) {
		struct incise_error err = {0};
		struct incise_vision_setup setup;
		struct incise_vision *vision;
		struct incise_rig *rig;
		struct seen air = {.n = 0}, tissue = {.n = 0};
		struct incise_depth_fit fit[2];
		double truth, gauge;
		char spec[200];

		state = n * 1000003ull;
		truth = 0.118 + 0.022 * uniform();
		snprintf(spec, sizeof(spec),
			 "sim:clock=simulated,seed=%d,cut_s=2,camera_mm_px=%.9f", n,
			 truth);
		rig = incise_rig_open(spec, INCISE_RIG_CAMERA, &err);
		if (!rig || incise_rig_vision(rig, &setup))
			fail(&err);
		setup.full_px = setup.depth_mm_px = 0;
		vision = incise_vision_new(&setup, &err);
		if (!vision)
			fail(&err);
		look(rig, vision, &air, &tissue);
		incise_vision_free(vision);
		incise_rig_close(rig);

		struct incise_depth_points points = {
			.length_mm = LENGTH_MM + U_LENGTH_MM * normal(),
			.u_length_mm = U_LENGTH_MM,
			.length_px = air.px,
			.n = air.n,
			.u_px = U_VISION_PX,
		};
		struct incise_depth_lengths pairs = {tissue.mm, tissue.px, tissue.n,
						     U_GAUGE, 0};

		gauge = 1 + U_GAUGE * normal();
		for (int i = 0; i < tissue.n; i++)
			tissue.mm[i] = tissue.mm[i] * gauge + GAUGE_MM * normal();
		if (incise_calibrate_depth_points(&points, NULL, &fit[0], &err) ||
		    incise_calibrate_depth_line(&pairs, NULL, &fit[1], &err))
			fail(&err);
		for (int k = 0; k < 2; k++) {
			double wrong = fit[k].mm_px / truth - 1;

			held[k] += fabs(wrong) * truth <= 2 * fit[k].u_mm_px;
			worst[k] = fmax(worst[k], fabs(wrong));
			off[k] += wrong / RIGS;
		}
		held_full +=
			fabs(fit[1].full_px - LENGTH_MM / truth) <= 2 * fit[1].u_full_px;
	}
	for (int k = 0; k < 2; k++) {
		printf("%-10s %d rigs: the interval holds the truth in %.1f %%; mean error "
		       "%+.4f %%, largest %.4f %%\n",
		       k ? "line" : "two-point", RIGS, 100.0 * held[k] / RIGS,
		       100 * off[k], 100 * worst[k]);
		good &= held[k] >= 184 && held[k] <= 196 && worst[k] < 1e-3;
	}
	printf("%-10s full_px: %.1f %%\n", "line", 100.0 * held_full / RIGS);
	return !good;
}
