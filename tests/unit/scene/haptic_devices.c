// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The largest stiffness of a wall that a plan states for a haptic device, against the largest that comes to rest
 * with the simulated one and the worst of some hands: a loop that shares no line with the checks. The checks keep 4 % of
 * the stiffness and of the device's damping in reserve.
 *
 *   hand leans ─▶ sim:haptic ── its samples, late ──▶ stylus, plan ── force, late ──╮
 *                    ▲                                                              │
 *                    ╰──────────────────────────────────────────────────────────────╯
 *
 * mm, N, s.
 */
#include "../unit.h"
#include <incise/plan.h>
#include "../cases.h"
#include "drawn.h"

#define DEVICES 30
#define DEVICES_FEW 2
#define WITHIN \
	0.9 /* the plan's to the loop's; with ticks or samples a whole multiple of the other */

#define RIG (INCISE_RIG_TRACKER | INCISE_RIG_STEPPER)
#define REACTION 20.0 /* N/mm at a gain of 1; the largest gain is 10 */
#define LEAN_S 1.3    /* after the stylus's start */
#define WINDOW_S 0.5
#define WINDOWS 40
#define REST_MM 1e-3
#define REST_STEPS 2.5 /* of the encoder */
#define FALLS 0.95     /* the swing of a window against those before, if it fades */

struct device {
	double mass_kg, damping_N_s_mm, rate_hz, latency_ms, force_latency_ms, tick_hz;
	double motor_ms, encoder_mm;
};

static const struct {
	const char *name, *keys;
} hands[] = {
	{"none", "hand_kg=0,hand_N_mm=0,hand_N_s_mm=0"},
	{"damped", "hand_kg=0.05,hand_N_mm=0.1,hand_N_s_mm=0.005"},
	{"firm", ""},
	/* of all cases only */
	{"of 0.05 kg", "hand_kg=0.05,hand_N_mm=0,hand_N_s_mm=0"},
	{"of 0.1 kg", "hand_kg=0.1,hand_N_mm=0,hand_N_s_mm=0"},
	{"of 0.25 kg", "hand_kg=0.25,hand_N_mm=0,hand_N_s_mm=0"},
};
#define HANDS (cases_are_all() ? 6 : 3)

/* A touch with a hard lean, a drop with a light one; at other phases of samples and ticks. */
static const struct {
	double lean_N, above_mm, phase;
} leans[] = {{3.8, 0.1, 0}, {0.7, 3, 0.45}};
#define LEANS ((int)(sizeof(leans) / sizeof(*leans)))

static struct incise_rig *open_rig(const struct device *d, int lean, const char *hand)
{
	struct incise_rig *rig;
	char spec[400];

	snprintf(
		spec, sizeof(spec),
		"sim:haptic,clock=simulated,mass_kg=%g,damping_N_s_mm=%g,rate_hz=%g,"
		"latency_ms=%g,force_latency_ms=%g,motor_ms=%g,encoder_mm=%g,motion=lean,"
		"begin_s=%g,lean_N=%g,z_mm=%g%s%s",
		d->mass_kg, d->damping_N_s_mm, d->rate_hz, d->latency_ms,
		d->force_latency_ms, d->motor_ms, d->encoder_mm, LEAN_S,
		leans[lean].lean_N, leans[lean].above_mm, *hand ? "," : "", hand);
	rig = incise_rig_open(spec, RIG, &err);
	succeeds(rig);
	return rig;
}

static struct incise_scene *wall_scene(const struct device *d, double N_mm)
{
	struct incise_scene *scene;
	char text[400];

	snprintf(text, sizeof(text),
		 "rate_hz = %.1f;\ntissue = { reaction_N_mm = %.1f; gain = %.9f; };\n"
		 "limits = { force_N = 4.0; slew_N_s = 1.0e5; pose_age_ms = 50.0; };\n",
		 d->tick_hz, REACTION, N_mm / REACTION);
	scene = fed_scene(&folder, text, &err);
	succeeds(scene);
	return scene;
}

/* The stiffness that a refusal of far too much advises, N/mm; a plan accepts it. */
static double find_planned(const struct device *d)
{
	static const char words[] = "set tissue.gain to at most ";
	struct incise_rig *rig = open_rig(d, 0, "");
	struct incise_scene *scene = wall_scene(d, 10 * REACTION);
	struct incise_error why = {0};
	struct incise_plan *plan = incise_plan_new(scene, rig, &why);
	const char *advice = strstr(why.text, words);

	assert_null(plan);
	if (!advice)
		fail_msg("%s", why.text);
	incise_scene_free(scene);
	incise_rig_close(rig);
	return REACTION * atof(advice + strlen(words));
}

static bool is_accepted(const struct device *d, double N_mm)
{
	struct incise_rig *rig = open_rig(d, 0, "");
	struct incise_scene *scene = wall_scene(d, N_mm);
	struct incise_plan *plan = incise_plan_new(scene, rig, &err);
	bool accepted = plan;

	incise_plan_free(plan);
	incise_scene_free(scene);
	incise_rig_close(rig);
	return accepted;
}

/* The ranges of the place in windows, until one is at rest. Returns their number. */
static int swing(struct incise_plan *plan, struct incise_clock *clock, double tick_hz,
		 double phase, double range_mm[WINDOWS])
{
	int64_t from_ns = incise_clock_now(clock) + llround(phase * 1e9 / tick_hz);
	int window = (int)(WINDOW_S * tick_hz), air = (int)(LEAN_S * tick_hz), n = 0;
	double low = INFINITY, high = -INFINITY;
	struct incise_tick tick;

	for (int i = 0; n < WINDOWS; i++) {
		incise_clock_wait_until(clock, from_ns + llround(i * 1e9 / tick_hz));
		assert_int_equal(incise_plan_tick(plan, incise_clock_now(clock), &tick),
				 0);
		if (i < air)
			continue;
		low = fmin(low, tick.position_mm[2]);
		high = fmax(high, tick.position_mm[2]);
		if ((i + 1 - air) % window)
			continue;
		range_mm[n++] = high - low;
		if (n > 4 && high - low < REST_MM)
			break;
		low = INFINITY;
		high = -INFINITY;
	}
	return n;
}

static bool rests(const struct device *d, double N_mm, int hand, int lean)
{
	struct incise_scene *scene = wall_scene(d, N_mm);
	struct incise_rig *rig = open_rig(d, lean, hands[hand].keys);
	struct incise_plan *plan;
	double range_mm[WINDOWS], last;
	int n;

	scene->unchecked = true;
	plan = incise_plan_new(scene, rig, &err);
	succeeds(plan);
	n = swing(plan, incise_rig_clock(rig), d->tick_hz, leans[lean].phase, range_mm);
	last = range_mm[n - 1];
	incise_plan_free(plan);
	incise_scene_free(scene);
	incise_rig_close(rig);
	return last < fmax(REST_MM, REST_STEPS * d->encoder_mm) ||
	       last < FALLS * fmax(range_mm[n - 3], range_mm[n - 5]);
}

/* The first hand with which it does not rest; HANDS: it always does. */
static int find_swing(const struct device *d, double N_mm)
{
	for (int hand = 0; hand < HANDS; hand++)
		for (int lean = 0; lean < LEANS; lean++)
			if (!rests(d, N_mm, hand, lean))
				return hand;
	return HANDS;
}

#define RAISED 1.06
#define HALVINGS 3

/* The largest stiffness from @N_mm on that rests with all hands; less than that where it does not. */
static double find_limit(const struct device *d, double N_mm, int *worst)
{
	double low = N_mm, high;

	while (find_swing(d, low) < HANDS)
		low /= RAISED;
	for (high = RAISED * low; (*worst = find_swing(d, high)) == HANDS; high *= RAISED)
		low = high;
	for (int i = 0; i < HALVINGS; i++) {
		double middle = (low + high) / 2;
		int hand = find_swing(d, middle);

		*(hand == HANDS ? &low : &high) = middle;
		*worst = hand == HANDS ? *worst : hand;
	}
	return low;
}

static double round_to(double x, double unit)
{
	return unit * round(x / unit);
}

/* Ticks as often as samples, or half or twice as often. */
static struct device draw_device(uint64_t seed)
{
	static const double rates_hz[] = {500, 1000, 1000, 2000, 3000, 4000, 5000};
	static const double of[] = {1, 1, 1, 0.5, 2};
	struct device d = {0};

	d.mass_kg = sized(&seed, 0.02, 0.5);
	d.damping_N_s_mm = sized(&seed, 0.001, 0.05);
	d.rate_hz = rates_hz[below(&seed, 7)];
	d.tick_hz = fmin(d.rate_hz * of[below(&seed, 5)], 5000);
	d.latency_ms = round_to(sized(&seed, 0.1, 4), 0.02);
	d.force_latency_ms =
		chance(&seed, 0.3) ? 0 : round_to(sized(&seed, 0.1, 4), 0.02);
	d.force_latency_ms = fmin(d.force_latency_ms, 15e3 / d.tick_hz);
	return d;
}

TEST(a_plan_states_the_stiffness_of_a_device)
{
	int n = cases_are_all() ? DEVICES : DEVICES_FEW;
	uint64_t seed = cases_seed(1);

	for (int i = 0; i < n; i++) {
		struct device d = draw_device(seed + (uint64_t)i);
		double planned = find_planned(&d), limit;
		int worst;

		assert_true(is_accepted(&d, planned));
		limit = find_limit(&d, planned, &worst);
		printf("%.3f kg %.4f N s/mm %4.0f Hz %.2f ms, force %.2f ms, ticks %4.0f Hz: plan %.3g N/mm, "
		       "loop %.3g with hand %s, share %.3f\n",
		       d.mass_kg, d.damping_N_s_mm, d.rate_hz, d.latency_ms,
		       d.force_latency_ms, d.tick_hz, planned, limit, hands[worst].name,
		       planned / limit);
		assert_true(planned <= limit && planned >= WITHIN * limit);
	}
}

/* A hard surface needs 0.8 to 1 N/mm: Choi and Tan, Perceived instability of virtual haptic texture, 2004. */
TEST(a_torque_motor_renders_a_hard_wall)
{
	static const struct {
		struct device device;
		double N_mm;
	} motors[] = {
		{{0.1, 0.005, 1000, 0.2, 0.2, 1000, 0.1, 0.01}, 0.8},
		{{0.1, 0.005, 5000, 0.2, 0.1, 5000, 0.1, 0.01}, 1.5},
	};

	for (int i = 0; i < 2; i++) {
		const struct device *d = &motors[i].device;

		if (cases_are_all())
			printf("%.0f Hz: plan %.3g N/mm\n", d->tick_hz, find_planned(d));
		if (!is_accepted(d, motors[i].N_mm))
			fail_msg("%s", err.text);
		assert_int_equal(find_swing(d, motors[i].N_mm), HANDS);
	}
}

GROUP(drawn_set_up, drawn_tear_down);
