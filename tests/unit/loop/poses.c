// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Poses as a tracker may send them through all that turns them into a force: bytes, the stream of
 * lib/device/polhemus, the loop, the virtual actuator, in simulated time. Spells of flags,
 * silence, repeated poses, jumps and records that are held up follow each other at random:
 *
 *   hand ─► records ─► flags, repeats, jumps, silence, delay ─► stream ─► loop ─► actuator
 *                           │                                              │
 *                           └── last good pose ──────► compared ◄── force ─┘
 *
 * The force is within its limit at each tick, and 0 once the last good pose is older than
 * limits.pose_age_ms and the longest fade.
 */
#include "../unit.h"
#include <incise/backend.h>
#include <incise/loop.h>
#include "../../../lib/base/random.h"
#include "../../../lib/device/polhemus/polhemus_stream.h"
#include "../scene/felt.h"
#include "../cases.h"

#define POSES 1000000
#define FORCE_N 3.0
#define SLEW_N_S 300.0
#define POSE_AGE_MS 50
#define REPEAT_MS 100
#define MS INT64_C(1000000)
#define FRICTION_N 0.01	     /* of the handle: sim.handle_friction_N */
#define SETTLE_NS (300 * MS) /* the nut's way back, and the handle with it */

enum spell { GOOD, FLAGGED, REPEATED, JUMPED, SILENT, HELD_UP, SPELLS };

/* Flags of both models: by their manual, not by the library. */
static const char bad_flags[] = "xjkabgyslzAGI?3", warnings[] = " u";

struct sender {
	struct incise_clock *clock;
	struct polhemus_stream stream;
	enum polhemus_family family;
	uint64_t random;
	int64_t start_ns, period_ns, latency_ns, held_until_ns;
	uint64_t k; /* next record */
	enum spell spell;
	uint64_t spell_end;
	float pose[7], jump_cm[3];
	char flag;
	int64_t same_ns;	 /* arrival of the first record with the same pose */
	int64_t good_ns;	 /* arrival of the last good pose */
	uint64_t spells[SPELLS]; /* number of each */
};

static struct sender sender;

static double draw(double least, double most)
{
	return least + (most - least) * (incise_random_symmetric(&sender.random) + 1) / 2;
}

static uint64_t draw_length(double most)
{
	/* As many short ones as long ones. */
	return (uint64_t)exp(draw(0, log(most))) + 1;
}

static void next_spell(struct sender *s)
{
	/* Good ones in between, so that it never ends as a tracker that is lost. */
	s->spell = s->spell == GOOD ? (enum spell)draw(FLAGGED, SPELLS) : GOOD;
	s->spell_end = s->k + draw_length(s->spell == GOOD ? 600 : 300);
	s->spells[s->spell]++;
	for (int i = 0; i < 3; i++)
		s->jump_cm[i] = (float)(copysign(exp(draw(-2, 6)), draw(-1, 1)));
	s->flag = bad_flags[(size_t)draw(0, sizeof(bad_flags) - 1)];
	if (s->spell == HELD_UP)
		s->held_until_ns = s->start_ns + (int64_t)s->spell_end * s->period_ns;
}

/* A hand that goes down into the tissue and out of it, with a tracker's noise. */
static void measure(struct sender *s)
{
	double t = (double)s->k * (double)s->period_ns * 1e-9;

	s->pose[0] = (float)(10 + 2 * sin(0.9 * t) + 0.002 * draw(-1, 1));
	s->pose[1] = (float)(0.002 * draw(-1, 1));
	s->pose[2] = (float)(-0.8 + 1.2 * sin(1.7 * t) + 0.002 * draw(-1, 1));
	if (s->spell == JUMPED)
		for (int i = 0; i < 3; i++)
			s->pose[i] += s->jump_cm[i];
	s->pose[3] = 1;
	s->pose[4] = s->pose[5] = s->pose[6] = 0;
}

static size_t record(const struct sender *s, char flag, unsigned char *to)
{
	uint32_t frame = (uint32_t)s->k;

	if (s->family == POLHEMUS_FASTRAK) {
		memcpy(to, (unsigned char[]){'0', '1', (unsigned char)flag}, 3);
		memcpy(to + 3, s->pose, 28);
		memcpy(to + 31, "0\r\n", 3);
		return 34;
	}
	memcpy(to, "LY\1C\0\0\44\0", 8);
	to[4] = flag == ' ' ? 0 : (unsigned char)flag;
	memcpy(to + 8, s->pose, 28);
	memcpy(to + 36, &frame, 4);
	memset(to + 40, 0, 4);
	return 44;
}

/* Send the next record, which arrives at @t_ns. */
static void send_record(struct sender *s, int64_t t_ns)
{
	unsigned char bytes[64];
	char flag = ' ';

	if (s->k >= s->spell_end)
		next_spell(s);
	if (s->spell == SILENT) {
		s->k++;
		return;
	}
	if (s->spell != REPEATED) {
		measure(s);
		s->same_ns = t_ns;
	}
	if (s->spell == FLAGGED)
		flag = s->flag;
	else if (draw(0, 1) < 0.01)
		flag = warnings[draw(0, 1) < 0.5];
	if (s->spell != FLAGGED && t_ns - s->same_ns <= REPEAT_MS * MS)
		s->good_ns = t_ns;
	polhemus_stream_put(&s->stream, bytes, record(s, flag, bytes), t_ns);
	s->k++;
}

static int64_t arrival_ns(const struct sender *s)
{
	int64_t t_ns = s->start_ns + (int64_t)s->k * s->period_ns + s->latency_ns;

	return t_ns < s->held_until_ns ? s->held_until_ns : t_ns;
}

static int read_sent(struct incise_tracker *tracker,
		     struct incise_tracker_sample *samples, int n)
{
	while (arrival_ns(&sender) <= incise_clock_now(sender.clock))
		send_record(&sender, arrival_ns(&sender));
	return incise_ring_take(&sender.stream.ring, samples, n);
}

struct seen {
	int64_t most_ns; /* a force lasts so long behind the last good pose */
	double step_N;	 /* of the actuator: its force is off by so much */
	double rest_N;	 /* and by dry friction, which holds the handle where it stops */
	double last_N[3], actuated_max_N, rendered_max_N;
	uint64_t felt, faded,
		without; /* ticks with a force; fades; ticks that had to be 0 */
	bool late;
};

static int look(void *context, const struct incise_tick *tick)
{
	struct seen *seen = context;
	double force_N = 0, change_N = 0;
	int64_t since_ns = tick->t_ns - (sender.good_ns - sender.latency_ns);
	bool late = !sender.good_ns || since_ns > seen->most_ns;

	for (int i = 0; i < 3; i++) {
		double change = tick->command_N[i] - seen->last_N[i];

		force_N += tick->command_N[i] * tick->command_N[i];
		change_N += change * change;
		seen->last_N[i] = tick->command_N[i];
	}
	force_N = sqrt(force_N);
	if (!(force_N <= FORCE_N))
		fail_msg("record %llu: %.17g N", (unsigned long long)sender.k, force_N);
	/* Rounding: 8 ulp of the force, as of limit.h. */
	if (!(sqrt(change_N) <= SLEW_N_S / 1000 + 8 * FORCE_N * 2.3e-16))
		fail_msg("record %llu: it changes by %.17g N",
			 (unsigned long long)sender.k, sqrt(change_N));
	if (late && force_N > 0)
		fail_msg("record %llu, spell %d: %g N, %.1f ms after the last good pose",
			 (unsigned long long)sender.k, sender.spell, force_N,
			 (double)since_ns * 1e-6);
	if (!(fabs(tick->rendered_N[0]) <= (since_ns > seen->most_ns + SETTLE_NS
						    ? seen->rest_N
						    : FORCE_N + seen->step_N)))
		fail_msg(
			"record %llu: the actuator pushes with %g N, %.1f ms after the last "
			"good pose",
			(unsigned long long)sender.k, tick->rendered_N[0],
			(double)since_ns * 1e-6);
	seen->rendered_max_N = fmax(seen->rendered_max_N, fabs(tick->rendered_N[0]));
	seen->actuated_max_N = fmax(seen->actuated_max_N, fabs(tick->actuated_N[0]));
	seen->felt += force_N > 0;
	seen->faded += late && !seen->late;
	seen->without += late;
	seen->late = late;
	return 0;
}

static uint64_t number_of_poses(void)
{
	return (uint64_t)cases_of(POSES, POSES / 20);
}

static struct incise_scene *make_scene(void)
{
	char folder[] = "/tmp/incise-poses-XXXXXX", path[40], model[40];
	struct incise_scene *scene;
	FILE *out;

	if (!mkdtemp(folder))
		abort();
	snprintf(path, sizeof(path), "%s/x.scene", folder);
	snprintf(model, sizeof(model), "%s/x.fis", folder);
	felt_write_model(model);
	out = fopen(path, "w");
	if (!out)
		abort();
	fprintf(out,
		"model = \"x.fis\"; tissue = { plane_N_mm = 0.1; };\n"
		"limits = { force_N = %g; slew_N_s = %g; pose_age_ms = %d.0; };\n",
		FORCE_N, SLEW_N_S, POSE_AGE_MS);
	fclose(out);
	scene = incise_scene_load(path, NULL, &err);
	unlink(path);
	unlink(model);
	rmdir(folder);
	succeeds(scene);
	return scene;
}

static void run(enum polhemus_family family, uint64_t poses)
{
	static struct incise_loop_stats stats;
	struct incise_tracker_setup setup = {.n_stations = 1,
					     .stations = {1},
					     .hemisphere = {1, 0, 0},
					     .repeat_ms = REPEAT_MS};
	struct polhemus_layout layout = {
		.family = family, .stations = 1, .switch_bytes = 1};
	int hz = (int)polhemus_family_hz(family, 1);
	struct incise_scene *scene = make_scene();
	struct incise_stepper_info stepper;
	struct incise_tracker_info info;
	struct incise_tracker_ops ops;
	const struct incise_tracker_ops *own;
	struct incise_tracker *tracker;
	struct seen seen = {0};
	struct incise_loop_options options = {.rate_hz = 1000,
					      .duration_ns = (int64_t)(poses + 1) *
							     INCISE_NS_PER_S / hz,
					      .ticked = look,
					      .context = &seen};
	struct incise_plan *plan;
	struct incise_rig *rig;
	char spec[80];

	snprintf(spec, sizeof(spec), "sim:clock=simulated,tracker_hz=%d", hz);
	rig = incise_rig_open(spec, INCISE_RIG_TRACKER | INCISE_RIG_STEPPER, &err);
	succeeds(rig);
	plan = incise_plan_new(scene, rig, &err);
	succeeds(plan);
	tracker = incise_rig_tracker(rig);
	incise_tracker_info(tracker, &info);
	sender = (struct sender){
		.clock = incise_rig_clock(rig),
		.family = family,
		.random = (uint64_t)family + 1,
		.period_ns = INCISE_NS_PER_S / hz,
		.latency_ns = info.latency_ns,
	};
	sender.start_ns = incise_clock_now(sender.clock);
	assert_int_equal(polhemus_stream_init(&sender.stream, &setup, &layout), 0);
	own = tracker->ops;
	ops = *own;
	ops.read = read_sent;
	tracker->ops = &ops;
	/* A tick finds the age too large, and the next one is the first of the fade. */
	incise_stepper_info(incise_rig_stepper(rig), &stepper);
	seen.step_N = stepper.spring_N_mm * stepper.step_mm;
	seen.rest_N = seen.step_N + FRICTION_N;
	seen.most_ns = POSE_AGE_MS * MS + incise_plan_fade_ns(plan) + 2 * MS;
	succeeds(!incise_loop_run(plan, sender.clock, &options, &stats, &err));
	print_message(
		"%s: %llu poses, %llu not used; %llu ticks with a force of %llu, at most "
		"%.3f N (rendered %.3f of %.3f); %llu times no pose, %llu ticks of it\n",
		polhemus_family_name(family), (unsigned long long)stats.poses.poses,
		(unsigned long long)stats.poses.unusable, (unsigned long long)seen.felt,
		(unsigned long long)stats.ticks, stats.force_max_N, seen.rendered_max_N,
		seen.actuated_max_N, (unsigned long long)seen.faded,
		(unsigned long long)seen.without);
	/* So it was tried. */
	assert_true(sender.k >= poses);
	for (int i = 0; i < SPELLS; i++)
		assert_true(sender.spells[i] > 20);
	assert_true(seen.felt > stats.ticks / 5);
	assert_true(seen.faded > 20);
	assert_true(stats.flagged[__builtin_ctz(INCISE_TICK_CLAMPED)] > 0);
	assert_true(stats.poses.flagged['='] > 0 && stats.poses.flagged['x'] > 0);
	tracker->ops = own;
	polhemus_stream_free(&sender.stream);
	incise_plan_free(plan);
	incise_rig_close(rig);
	incise_scene_free(scene);
}

TEST(test_fastrak)
{
	run(POLHEMUS_FASTRAK, number_of_poses() / 2);
}

TEST(test_liberty)
{
	run(POLHEMUS_LIBERTY, number_of_poses() / 2);
}
