// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The error of lib/control/predict.c, and the change of force that its corrections cause, on the
 * reference path and on the virtual rig.
 *
 * The reference path: a hand in one direction as a tracker sees it, mm and s.
 *
 *   path(t) = 3.2 sin(2π 1.1 t + φ0) + 1.7 sin(2π 3.1 t + φ1) voluntary
 *           + 0.03 sin(2π 10 t + φ2)                          tremor
 *
 * It is rebuilt from figures that were given without their path. Velocity taken by finite
 * differences of 1 kHz samples quantised by 30, 5 and 1 µm was off by 44, 7.5 and 1.7 % of
 * its rms, which asks for 28 mm/s rms and about 470 mm/s² rms. The amplitudes make 28.2
 * and 476, and differences off by 44.6, 7.3 and 1.7 %. A tracker with 4.2 ms of latency
 * and 0.02 mm of noise then shows, rms in mm, here and as given:
 *
 *              hold the last pose    constant velocity, extrapolated
 *     240 Hz      .183   .163            .043   .025
 *     120 Hz      .245   .243            .057   .054
 *      60 Hz      .376   .379            .090   .090
 *
 * and corrections of up to 0.3 mm at 120 Hz (0.2). Only at 240 Hz, where noise decides,
 * is this tracker worse than that of the figures.
 */
#include "../unit.h"
#include <incise/clock.h>
#include <incise/rig.h>
#include <incise/tracker.h>
#include "../../../lib/base/vector.h"
#include "../../../lib/base/random.h"
#include "../../../lib/control/predict.h"
#include "../../../lib/sim/sim.h"

#define REFERENCE_LATENCY_NS 4200000
#define REFERENCE_NOISE_MM 0.02

static const struct {
	double mm, hz, phase;
} reference_part[3] = {{3.2, 1.1, 0.3}, {1.7, 3.1, 1.9}, {0.03, 10, 4.1}};

static double reference_mm(double t)
{
	double x = 0;

	for (int i = 0; i < 3; i++)
		x += reference_part[i].mm *
		     sin(2 * M_PI * reference_part[i].hz * t + reference_part[i].phase);
	return x;
}

static double reference_mm_s(double t)
{
	double v = 0;

	for (int i = 0; i < 3; i++) {
		double w = 2 * M_PI * reference_part[i].hz;

		v += reference_part[i].mm * w * cos(w * t + reference_part[i].phase);
	}
	return v;
}

#define S 1e-9

/* All that is asked for at one time. */
struct pose {
	double x[3], v[3], q[4];
};

/* The constant-velocity Kalman filter to compare with; of Kalata's gains too. */
struct constant_velocity {
	double alpha, beta, x, v, t;
};

static void constant_velocity_init(struct constant_velocity *c, double period)
{
	/* 800 mm/s² is near the best for each of the rates. */
	double index = 800 * period * period / REFERENCE_NOISE_MM;
	double r = (4 + index - sqrt(8 * index + index * index)) / 4;

	*c = (struct constant_velocity){.alpha = 1 - r * r,
					.beta = 2 * (1 - r) * (1 - r)};
}

static void constant_velocity_add(struct constant_velocity *c, double t, double x)
{
	double dt = t - c->t, miss = x - c->x - c->v * dt;

	c->x += c->v * dt + c->alpha * miss;
	if (dt > 0)
		c->v += c->beta / dt * miss;
	c->t = t;
}

/* The filter without the blend. */
static double bare(const struct incise_predict *p, int64_t t_ns)
{
	const struct incise_double_predict *now = &p->now;
	double dt = (double)(t_ns - now->t_ns) * S;

	return now->x[0] + now->v[0] * dt + now->a[0] * dt * dt / 2;
}

/* The result of a run at 1 kHz; errors rms, steps largest in one tick. */
struct result {
	double hold, constant_velocity, bare, shown; /* mm */
	double velocity;			     /* mm/s */
	double bare_step, step, blend_step;	     /* relative to the force */
};

/*
 * 40 s of the reference path about a depth of 7 mm: 2.1 to 11.9 mm, so that at 1 N/mm the
 * force is 2.1 to 11.9 N. A step is the change of the force shown in one tick less the
 * change of the true force in it, against the true force then. In blend_step only what
 * the blend changes in a tick is counted.
 */
static struct result run(int rate)
{
	struct incise_tracker_info info = {
		.name = "test", .rate_hz = rate, .latency_ns = REFERENCE_LATENCY_NS};
	struct incise_predict p;
	struct constant_velocity c;
	struct result sum = {0};
	double last_shown = 0, last_bare = 0, last_truth = 0, last_z = 0;
	int count = 0;

	incise_predict_init(&p, &info, 0);
	constant_velocity_init(&c, 1.0 / rate);
	for (int64_t tick = 0, n = 0; tick < 40000; tick++) {
		int64_t now = tick * 1000000;
		double truth = 7 + reference_mm(now * S), without;
		struct pose pose;

		for (;; n++) {
			int64_t then = n * INCISE_NS_PER_S / rate;
			double z = 7 + reference_mm(then * S) +
				   REFERENCE_NOISE_MM * incise_random_normal(1, n);

			if (then + REFERENCE_LATENCY_NS > now)
				break;
			incise_predict_add(&p,
					   &(struct incise_tracker_sample){
						   .t_ns = then + REFERENCE_LATENCY_NS,
						   .position_mm = {z},
						   .quaternion = {1}});
			constant_velocity_add(&c, then * S, z);
			last_z = z;
		}
		incise_predict_at(&p, now, pose.x, pose.v, pose.q);
		without = bare(&p, now);
		/* Half a second is ten times what the filters need to settle. */
		if (tick > 500) {
			double moved = truth - last_truth;

			sum.hold += pow(last_z - truth, 2);
			sum.constant_velocity +=
				pow(c.x + c.v * (now * S - c.t) - truth, 2);
			sum.bare += pow(without - truth, 2);
			sum.shown += pow(pose.x[0] - truth, 2);
			sum.velocity += pow(pose.v[0] - reference_mm_s(now * S), 2);
			sum.bare_step = fmax(sum.bare_step,
					     fabs(without - last_bare - moved) / truth);
			sum.step = fmax(sum.step,
					fabs(pose.x[0] - last_shown - moved) / truth);
			sum.blend_step =
				fmax(sum.blend_step,
				     fabs(p.now.x_shown[0]) * 1e-3 / p.period_s / truth);
			count++;
		}
		last_shown = pose.x[0];
		last_bare = without;
		last_truth = truth;
	}
	sum.hold = sqrt(sum.hold / count);
	sum.constant_velocity = sqrt(sum.constant_velocity / count);
	sum.bare = sqrt(sum.bare / count);
	sum.shown = sqrt(sum.shown / count);
	sum.velocity = sqrt(sum.velocity / count);
	return sum;
}

TEST(test_reference_path)
{
	static const struct {
		int rate;
		double hold, constant_velocity; /* as given, mm */
		double shown_mm;		/* not above */
		double velocity_mm_s;		/* not above */
	} rates[] = {
		/* 0.06 mm at 120 Hz was asked for; the others are a tenth above what is. */
		{240, 0.163, 0.025, 0.039, 4.2},
		{120, 0.243, 0.054, 0.060, 5.5},
		{60, 0.379, 0.090, 0.108, 8.4},
	};

	for (int i = 0; i < 3; i++) {
		struct result r = run(rates[i].rate);

		print_message(
			"%3d Hz: hold %.4f cv %.4f unblended %.4f shown %.4f mm, "
			"velocity %.2f mm/s, steps %.2f %% unblended, %.2f %% shown, "
			"%.2f %% of the blend\n",
			rates[i].rate, r.hold, r.constant_velocity, r.bare, r.shown,
			r.velocity, 100 * r.bare_step, 100 * r.step, 100 * r.blend_step);
		/* The path is like the one of the figures: see there, and why not at 240 Hz. */
		assert_true(fabs(r.hold / rates[i].hold - 1) < (i ? 0.02 : 0.14));
		if (i)
			assert_true(
				fabs(r.constant_velocity / rates[i].constant_velocity -
				     1) < 0.06);
		assert_true(r.bare < r.constant_velocity);
		assert_true(r.shown < rates[i].shown_mm);
		assert_true(r.step < 0.02 && r.blend_step < 0.02);
		assert_true(r.bare_step > 0.03);
		assert_true(r.velocity < rates[i].velocity_mm_s);
	}
}
