// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A simulated haptic device with a hand on it, on any clock; rig.conf(5) has its keys.
 *
 *   hand's script ─ spring ─▶ handle ─ play ─ encoder ─▶ sample ─ latency ─▶ read()
 *                                │
 *   push() ─ force_latency ─▶ motor: its lag and largest force
 *
 * It advances in steps of 20 µs up to the clock's time when it is read or pushed, so that its samples do not
 * depend on when that is. Each axis is a mass of its own:
 *
 *   (device + hand) x'' = motor + stops - hand (x - script) - (damping + hand's) x' - friction
 *
 * mm, N, s; in the frame of the device, whose origin is the middle of its workspace.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "../base/random.h"
#include "../base/vector.h"
#include "sim.h"
#include "world.h"

#define STEP_NS 20000
#define STEP_S 20e-6
#define NS 1e-9

#define PUSHES_HZ 20000 /* most that are kept on their way */
#define DRAWS 4		/* random numbers per sample: 3 position, a spare */
#define BUTTONS 2

enum motion { STILL, PRESS, CIRCLE, LEAN };
enum fault { UNPLUGGED, DIES, GIVES_NAN, LATE, CHANGES, NOT_READY, FAULTS };

struct config {
	double mass_kg, damping_N_s_mm, coulomb_N, stiction_N, backlash_mm;
	double encoder_mm, noise_mm, rate_hz, latency_ms, force_latency_ms;
	double motor_ms, peak_N, continuous_N, deadman_s, workspace_mm, stop_N_mm;
	double hand_kg, hand_N_s_mm, hand_N_mm;
	double x_mm, y_mm, z_mm, begin_s, cycle_s, depth_mm, radius_mm, lean_N;
	double button_from_s[BUTTONS], button_to_s[BUTTONS];
	double fault_s[FAULTS], late_ms;
	uint64_t seed;
	enum motion motion;
};

#define SETTINGS_OF struct config
#define REAL(name, ...) SETTING_NUMBER(name, name, __VA_ARGS__)
#define TIME(name, member, help) SETTING_NUMBER(name, member, "s", 0, 1e6, "0", help)

static const char *const motions[] = {"still", "press", "circle", "lean", NULL};

const struct incise_setting incise_sim_haptic_settings[] = {
	SETTING_WHOLE(seed, seed, "", 0, 2147483647, "1", "seed of the noise"),
	REAL(mass_kg, "kg", 0.001, 100, "0.1", "mass that the hand feels"),
	REAL(damping_N_s_mm, "N s/mm", 0, 10, "0.005", "viscous damping"),
	REAL(coulomb_N, "N", 0, 100, "0", "Coulomb friction"),
	REAL(stiction_N, "N", 0, 100, "0", "static friction in addition to that"),
	REAL(backlash_mm, "mm", 0, 10, "0", "play between handle and encoder"),
	REAL(encoder_mm, "mm", 0, 10, "0.01", "resolution of the position; 0: exact"),
	REAL(noise_mm, "mm", 0, 10, "0", "standard deviation of the position, per axis"),
	REAL(rate_hz, "Hz", 10, 20000, "1000", "samples per second"),
	REAL(latency_ms, "ms", 0, 100, "0.2", "from the acquisition to the arrival"),
	REAL(force_latency_ms, "ms", 0, 100, "0.2", "from a new force to the motor"),
	REAL(motor_ms, "ms", 0, 100, "0.1", "time constant of the motor's force"),
	REAL(peak_N, "N", 0.01, 1000, "8", "largest force of the motor"),
	REAL(continuous_N, "N", 0.01, 1000, "4", "force that it stands for ever"),
	REAL(deadman_s, "s", 0, 10, "0.1",
	     "no force so long after the last; 0: it stays"),
	REAL(workspace_mm, "mm", 1, 10000, "160", "edge of the workspace, a cube"),
	REAL(stop_N_mm, "N/mm", 0, 100, "1", "stiffness of its end stops"),
	/* A firm hand; see lib/scene/rest.c. */
	REAL(hand_kg, "kg", 0, 100, "0.554", "mass of the hand"),
	REAL(hand_N_s_mm, "N s/mm", 0, 10, "0.0258", "its damping"),
	REAL(hand_N_mm, "N/mm", 0, 1000, "0.54", "stiffness of its place"),
	SETTING_WORD(motion, motion, motions, "press",
		     "of the hand: still, press (down and back), circle, or lean"),
	REAL(x_mm, "mm", -1e4, 1e4, "0", "place of the hand until it begins, x"),
	REAL(y_mm, "mm", -1e4, 1e4, "0", "the same, y"),
	REAL(z_mm, "mm", -1e4, 1e4, "10", "the same, z"),
	REAL(begin_s, "s", 0, 1e6, "2", "time at which the motion begins"),
	REAL(cycle_s, "s", 0.01, 1e6, "4", "time of a press or a circle"),
	REAL(depth_mm, "mm", -1e4, 1e4, "5", "press: so far below z = 0"),
	REAL(radius_mm, "mm", 0, 1e4, "10", "circle: its radius"),
	REAL(lean_N, "N", 0, 100, "1", "lean: the constant force down"),
	TIME(button1_from_s, button_from_s[0], "button 1 is pressed from here …"),
	TIME(button1_to_s, button_to_s[0], "… to here"),
	TIME(button2_from_s, button_from_s[1], "button 2 is pressed from here …"),
	TIME(button2_to_s, button_to_s[1], "… to here"),
	TIME(unplugged_s, fault_s[UNPLUGGED], "an error from here; 0 in these: never"),
	TIME(dies_s, fault_s[DIES], "no more samples from here"),
	TIME(nan_s, fault_s[GIVES_NAN], "positions are no numbers from here"),
	TIME(late_s, fault_s[LATE], "samples are later by late_ms from here"),
	REAL(late_ms, "ms", 0, 1000, "20", "by so much"),
	TIME(changes_s, fault_s[CHANGES], "the device is another one from here"),
	TIME(not_ready_s, fault_s[NOT_READY], "the device is not ready from here"),
	{0},
};

struct axis {
	double at, v, motor_at;	  /* of the handle; the other side of the play */
	double pushed_N, motor_N; /* asked for; of the motor */
};

struct push {
	int64_t t_ns; /* at which it acts */
	double force_N[3];
};

struct sim_haptic {
	struct incise_haptic haptic;
	struct config config;
	struct incise_clock *clock;
	int64_t start_ns, t_ns; /* of the script, by the clock; of the script */
	int64_t fed_ns;		/* of the script, at the last push */
	uint64_t n, key;	/* next sample; of its noise */
	struct axis axis[3];
	struct incise_sim_ring pushes, samples;
};

static struct sim_haptic *of_haptic(const struct incise_haptic *haptic)
{
	return (struct sim_haptic *)haptic;
}

static INCISE_REALTIME bool has_fault(const struct sim_haptic *sim, enum fault fault,
				      int64_t t_ns)
{
	return sim->config.fault_s[fault] > 0 &&
	       (double)t_ns * NS >= sim->config.fault_s[fault];
}

/* --- hand and device -------------------------------------------------------------------- */

/* Where the hand wants to be. */
static INCISE_REALTIME void place_hand(const struct config *config, double t_s,
				       double place_mm[3])
{
	double turn = 2 * M_PI * (t_s - config->begin_s) / config->cycle_s;

	place_mm[0] = config->x_mm;
	place_mm[1] = config->y_mm;
	place_mm[2] = config->z_mm;
	if (t_s < config->begin_s)
		return;
	if (config->motion == PRESS)
		place_mm[2] -= (config->z_mm + config->depth_mm) * (1 - cos(turn)) / 2;
	if (config->motion == CIRCLE) {
		place_mm[0] += config->radius_mm * sin(turn);
		place_mm[1] += config->radius_mm * (1 - cos(turn));
	}
}

/* By the midpoint's rule, which neither adds nor takes energy; then friction takes its part of the speed. */
static INCISE_REALTIME void move_handle(const struct config *config, struct axis *axis,
					double force_N, double place_mm)
{
	double m = 1e-3 * (config->mass_kg + config->hand_kg), k = config->hand_N_mm;
	double A = STEP_S * (config->damping_N_s_mm + config->hand_N_s_mm) / m / 2;
	double B = STEP_S * STEP_S * k / m / 4, v, rub;

	v = axis->v * (1 - A - B) + STEP_S * (force_N - k * (axis->at - place_mm)) / m;
	v /= 1 + A + B;
	rub = STEP_S * (config->coulomb_N + (axis->v == 0 ? config->stiction_N : 0)) / m;
	v = fabs(v) <= rub ? 0 : v - copysign(STEP_S * config->coulomb_N / m, v);
	axis->at += STEP_S * (axis->v + v) / 2;
	axis->v = v;
}

/* The motor has no mass: at once it is at the side of the play to which it pushes. */
static INCISE_REALTIME void follow_handle(const struct config *config, struct axis *axis)
{
	double half_mm = config->backlash_mm / 2, apart_mm = axis->motor_at - axis->at;

	axis->motor_at =
		axis->at + (axis->motor_N == 0 ? fmax(-half_mm, fmin(apart_mm, half_mm))
					       : copysign(half_mm, axis->motor_N));
}

static INCISE_REALTIME void move_axis(struct sim_haptic *sim, int i, double place_mm)
{
	const struct config *config = &sim->config;
	struct axis *axis = &sim->axis[i];
	double free_mm = config->workspace_mm / 2, force_N;

	axis->motor_N += (axis->pushed_N - axis->motor_N) * STEP_S /
			 (STEP_S / 2 + fmax(config->motor_ms * 1e-3, STEP_S / 2));
	force_N = axis->motor_N - config->stop_N_mm * (fmax(axis->at - free_mm, 0) +
						       fmin(axis->at + free_mm, 0));
	if (i == 2 && config->motion == LEAN && (double)sim->t_ns * NS >= config->begin_s)
		force_N -= config->lean_N;
	move_handle(config, axis, force_N, place_mm);
	follow_handle(config, axis);
}

/* The forces that act by now. */
static INCISE_REALTIME void take_pushes(struct sim_haptic *sim)
{
	const struct push *push;

	while ((push = incise_sim_ring_peek(&sim->pushes)) && push->t_ns <= sim->t_ns) {
		for (int i = 0; i < 3; i++)
			sim->axis[i].pushed_N = push->force_N[i];
		incise_sim_ring_pop(&sim->pushes);
	}
	if (sim->config.deadman_s > 0 &&
	    (double)(sim->t_ns - sim->fed_ns) * NS > sim->config.deadman_s)
		for (int i = 0; i < 3; i++)
			sim->axis[i].pushed_N = 0;
}

/* --- samples ---------------------------------------------------------------------------- */

static INCISE_REALTIME double measure_axis(const struct sim_haptic *sim, int i,
					   double ahead_s)
{
	const struct axis *axis = &sim->axis[i];
	const struct config *config = &sim->config;
	double noise = incise_random_normal(sim->key, sim->n * DRAWS + (uint64_t)i);
	double mm = axis->motor_at + ahead_s * axis->v + config->noise_mm * noise;

	return config->encoder_mm > 0 ? config->encoder_mm * rint(mm / config->encoder_mm)
				      : mm;
}

/* The sample at @t_ns of the script, within a step after the device's. */
static INCISE_REALTIME void acquire_sample(struct sim_haptic *sim, int64_t t_ns)
{
	struct incise_haptic_sample to = {
		.t_ns = sim->start_ns + t_ns, .seq = sim->n, .quaternion = {1}};
	double ahead_s = (double)(t_ns - sim->t_ns) * NS, t_s = (double)t_ns * NS;
	bool spoilt = has_fault(sim, GIVES_NAN, t_ns);

	for (int i = 0; i < 3; i++) {
		to.position_mm[i] = spoilt ? NAN : measure_axis(sim, i, ahead_s);
		to.velocity_mm_s[i] = sim->axis[i].v;
	}
	for (int i = 0; i < BUTTONS; i++)
		if (t_s >= sim->config.button_from_s[i] &&
		    t_s < sim->config.button_to_s[i])
			to.buttons |= 1U << i;
	to.flags = (has_fault(sim, CHANGES, t_ns) ? INCISE_HAPTIC_CHANGED : 0) |
		   (has_fault(sim, NOT_READY, t_ns) ? INCISE_HAPTIC_NOT_READY : 0);
	if (!has_fault(sim, DIES, t_ns))
		incise_sim_ring_push(&sim->samples, &to);
	sim->n++;
}

static INCISE_REALTIME void acquire_samples(struct sim_haptic *sim, int64_t before_ns)
{
	int64_t t_ns;

	while ((t_ns = incise_sim_time(sim->n, sim->config.rate_hz)) < before_ns)
		acquire_sample(sim, t_ns);
}

/* Advance to the clock's time. Returns that. */
static INCISE_REALTIME int64_t advance(struct sim_haptic *sim)
{
	int64_t now_ns = incise_clock_now(sim->clock) - sim->start_ns;
	double place_mm[3];

	for (; sim->t_ns + STEP_NS <= now_ns; sim->t_ns += STEP_NS) {
		take_pushes(sim);
		acquire_samples(sim, sim->t_ns + STEP_NS);
		place_hand(&sim->config, (double)sim->t_ns * NS, place_mm);
		for (int i = 0; i < 3; i++)
			move_axis(sim, i, place_mm[i]);
	}
	acquire_samples(sim, now_ns + 1);
	return now_ns;
}

/* --- the device ------------------------------------------------------------------------- */

static INCISE_REALTIME int sim_read(struct incise_haptic *haptic,
				    struct incise_haptic_sample *samples, int n)
{
	struct sim_haptic *sim = of_haptic(haptic);
	int64_t now_ns = advance(sim), late_ns;
	const struct incise_haptic_sample *oldest;
	int taken = 0;

	if (has_fault(sim, UNPLUGGED, now_ns))
		return -ENODEV;
	late_ns = llround(sim->config.latency_ms * 1e6) +
		  (has_fault(sim, LATE, now_ns) ? llround(sim->config.late_ms * 1e6) : 0);
	while (taken < n && (oldest = incise_sim_ring_peek(&sim->samples)) &&
	       oldest->t_ns + late_ns <= sim->start_ns + now_ns) {
		samples[taken++] = *oldest;
		incise_sim_ring_pop(&sim->samples);
	}
	return taken;
}

static INCISE_REALTIME int sim_push(struct incise_haptic *haptic, const double force_N[3],
				    const double torque_N_mm[3])
{
	struct sim_haptic *sim = of_haptic(haptic);
	double share = fmin(1, sim->config.peak_N / fmax(v3_length(force_N), 1e-9));
	struct push push;

	(void)torque_N_mm;
	sim->fed_ns = advance(sim);
	if (has_fault(sim, UNPLUGGED, sim->fed_ns))
		return -ENODEV;
	push.t_ns = sim->fed_ns + llround(sim->config.force_latency_ms * 1e6);
	v3_add(push.force_N, (double[3]){0}, share, force_N);
	incise_sim_ring_push(&sim->pushes, &push);
	return 0;
}

static void sim_info(const struct incise_haptic *haptic, struct incise_haptic_info *info)
{
	const struct config *config = &of_haptic(haptic)->config;

	*info = (struct incise_haptic_info){
		.name = "simulated haptic device",
		.peak_N = config->peak_N,
		.continuous_N = config->continuous_N,
		.mass_kg = config->mass_kg,
		.damping_N_s_mm = config->damping_N_s_mm,
		.coulomb_N = config->coulomb_N,
		.encoder_mm = config->encoder_mm,
		.rate_hz = config->rate_hz,
		.latency_ns = llround(config->latency_ms * 1e6),
		/* A lag of first order is at most as late as its time constant. */
		.force_latency_ns =
			llround((config->force_latency_ms + config->motor_ms) * 1e6),
		.deadman_s = config->deadman_s,
		.buttons = BUTTONS,
		.features = INCISE_HAPTIC_PAGE_VELOCITY,
	};
	for (int i = 0; i < 3; i++) {
		info->high_mm[i] = config->workspace_mm / 2;
		info->low_mm[i] = -info->high_mm[i];
	}
}

static uint64_t sim_lost(const struct incise_haptic *haptic)
{
	return of_haptic(haptic)->samples.lost;
}

static int sim_cause(struct incise_haptic *haptic, char *text, size_t size)
{
	const struct sim_haptic *sim = of_haptic(haptic);
	static const char *const keys[FAULTS] = {
		"unplugged_s", "dies_s", "nan_s", "late_s", "changes_s", "not_ready_s"};

	const char *key = "";

	for (int i = 0; i < FAULTS; i++)
		if (has_fault(sim, (enum fault)i, sim->t_ns))
			key = keys[i];
	return snprintf(text, size,
			*key ? "simulated haptic device: its %s has passed; set it later"
			     : "%s",
			key);
}

static void sim_close(struct incise_haptic *haptic)
{
	struct sim_haptic *sim = of_haptic(haptic);

	incise_sim_ring_free(&sim->pushes);
	incise_sim_ring_free(&sim->samples);
	free(sim);
}

static const struct incise_haptic_ops ops = {
	.read = sim_read,
	.push = sim_push,
	.info = sim_info,
	.lost = sim_lost,
	.close = sim_close,
	.cause = sim_cause,
};

/* KEY=VALUE,… */
static int read_words(struct config *config, char *words, const char *where,
		      struct incise_error *err)
{
	struct incise_error why = {0};
	int rc = 0;

	while (!rc && words && *words) {
		char *key = strsep(&words, ","), *value = key;

		strsep(&value, "=");
		rc = incise_settings_set(incise_sim_haptic_settings, "sim", key,
					 value ? value : "", config, &why);
	}
	return rc ? incise_error_set(err, EINVAL, "%s: %s", where, why.text) : 0;
}

/* For 2.5 s, and those that have not arrived. */
static int make_rings(struct sim_haptic *sim)
{
	double late_s = (sim->config.latency_ms + sim->config.late_ms) * 1e-3;

	return incise_sim_ring_init(&sim->pushes, sizeof(struct push), PUSHES_HZ, 0) ||
			       incise_sim_ring_init(&sim->samples,
						    sizeof(struct incise_haptic_sample),
						    sim->config.rate_hz, late_s)
		       ? -ENOMEM
		       : 0;
}

struct incise_haptic *incise_sim_haptic_new(const struct incise_backend_request *request,
					    struct incise_error *err)
{
	struct sim_haptic *sim = calloc(1, sizeof(*sim));
	char *words = strdup(request->arguments);
	double place_mm[3];
	int rc = -ENOMEM;

	if (sim && words) {
		sim->haptic.ops = &ops;
		sim->clock = request->clock;
		sim->start_ns = incise_clock_now(sim->clock);
		incise_settings_init(incise_sim_haptic_settings, &sim->config);
		rc = read_words(&sim->config, words, request->where, err);
	}
	free(words);
	if (!rc)
		rc = make_rings(sim);
	if (rc == -ENOMEM)
		incise_error_set(err, ENOMEM, "%s: %s", request->where, strerror(ENOMEM));
	if (rc) {
		if (sim)
			sim_close(&sim->haptic);
		errno = -rc;
		return NULL;
	}
	sim->key = incise_random_key(sim->config.seed, INCISE_RANDOM_TRACKER);
	place_hand(&sim->config, 0, place_mm);
	for (int i = 0; i < 3; i++)
		sim->axis[i].at = sim->axis[i].motor_at = place_mm[i];
	return &sim->haptic;
}
