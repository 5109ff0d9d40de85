// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/sim/sim.c: one world, independent of readers, their rate and their clock; its rings.
 */
#include "../unit.h"
#include "../../../lib/sim/sim.h"
#include "../../../lib/sim/world.h"

#define START_NS INCISE_NS_PER_S
#define MAX 120000

/* All samples of a run of some seconds. */
struct log {
	struct incise_force_sample force[MAX];
	struct incise_tracker_sample tracker[MAX];
	int n_force, n_tracker;
	uint64_t lost;
};

static struct log first, second;

/* A pattern of reading: open devices, time between reads, samples per read. */
struct manner {
	bool force, tracker, camera;
	int64_t step_ns[3]; /* in turn */
	int portion;
};

static const struct manner plain = {
	true, true, false, {10000000, 10000000, 10000000}, 1000};

static void run(uint64_t seed, double seconds, const struct manner *manner,
		struct log *log)
{
	struct incise_clock *clock = incise_clock_new_simulated(START_NS);
	struct incise_sim_config config;
	struct incise_sim *sim;
	struct incise_force *force = NULL;
	struct incise_tracker *tracker = NULL;
	struct incise_camera *camera = NULL;
	int64_t end = START_NS + llround(seconds * 1e9), t = START_NS;

	incise_sim_config_init(&config);
	config.seed = seed;
	sim = incise_sim_new(&config, clock, NULL);
	assert_non_null(sim);
	if (manner->force)
		force = incise_sim_force_new(sim);
	if (manner->tracker)
		tracker = incise_sim_tracker_new(sim);
	if (manner->camera)
		camera = incise_sim_camera_new(sim);
	memset(log, 0, sizeof(*log));
	for (int turn = 0; t < end; turn++) {
		struct incise_camera_frame frame;
		int n;

		t += manner->step_ns[turn % 3];
		incise_clock_wait_until(clock, t < end ? t : end);
		if (camera)
			assert_true(incise_camera_read(camera, &frame) >= 0);
		do {
			n = force ? incise_force_read(force, log->force + log->n_force,
						      manner->portion)
				  : 0;
			log->n_force += n;
		} while (n);
		do {
			n = tracker ? incise_tracker_read(tracker,
							  log->tracker + log->n_tracker,
							  manner->portion)
				    : 0;
			log->n_tracker += n;
		} while (n);
	}
	log->lost = (force ? incise_force_lost(force) : 0) +
		    (tracker ? incise_tracker_lost(tracker) : 0);
	if (force)
		force->ops->close(force);
	if (tracker)
		tracker->ops->close(tracker);
	if (camera)
		camera->ops->close(camera);
	incise_sim_free(sim);
	incise_clock_free(clock);
}

/* Field by field: padding is not compared. */
static bool force_equal(const struct log *a, const struct log *b, int n)
{
	for (int i = 0; i < n; i++)
		if (a->force[i].t_ns != b->force[i].t_ns ||
		    a->force[i].seq != b->force[i].seq ||
		    a->force[i].code != b->force[i].code)
			return false;
	return true;
}

static bool tracker_equal(const struct log *a, const struct log *b, int n)
{
	for (int i = 0; i < n; i++) {
		const struct incise_tracker_sample *x = &a->tracker[i],
						   *y = &b->tracker[i];

		if (x->t_ns != y->t_ns || x->seq != y->seq || x->status != y->status ||
		    memcmp(x->position_mm, y->position_mm, sizeof(x->position_mm)) ||
		    memcmp(x->quaternion, y->quaternion, sizeof(x->quaternion)))
			return false;
	}
	return true;
}

TEST(reading_changes_nothing)
{
	static const struct manner row[] = {
		{true, false, false, {10000000, 10000000, 10000000}, 1000},
		{false, true, false, {10000000, 10000000, 10000000}, 1000},
		{true, true, false, {1, 99999, 250001}, 7},
		{true, true, false, {2400000000, 1, 33333}, MAX},
		{true, true, true, {777777, 40000000, 5}, 1},
	};

	run(1, 4, &plain, &first);
	for (size_t i = 0; i < sizeof(row) / sizeof(row[0]); i++) {
		run(1, 4, &row[i], &second);
		assert_int_equal(second.lost, 0);
		assert_int_equal(second.n_force, row[i].force ? first.n_force : 0);
		assert_int_equal(second.n_tracker, row[i].tracker ? first.n_tracker : 0);
		assert_true(force_equal(&first, &second, second.n_force));
		assert_true(tracker_equal(&first, &second, second.n_tracker));
	}
}

TEST(what_is_not_taken_is_lost_and_counted)
{
	static const struct manner late = {
		true, true, false, {10000000000, 10000000000, 10000000000}, MAX};

	run(1, 10, &late, &first);
	/* The newest 2.5 s or a little more remain, up to the end of the run. */
	assert_true(first.n_force >= 25000 && first.n_force < 25010);
	assert_int_equal(first.force[first.n_force - 1].seq, 99999);
	assert_true(first.n_tracker >= 300 && first.n_tracker < 310);
	assert_int_equal(first.lost, first.force[0].seq + first.tracker[0].seq);
	assert_true(first.force[0].seq > 0 && first.tracker[0].seq > 0);
	for (int i = 1; i < first.n_force; i++)
		assert_int_equal(first.force[i].seq, first.force[i - 1].seq + 1);
}

/* 0.2 s of real time or more. Returns the number of samples; 0: some were lost. */
static int run_in_real_time(struct log *log, int64_t *start_ns)
{
	struct incise_clock *clock = incise_clock_new_real();
	struct incise_sim_config config;
	struct incise_sim *sim;
	struct incise_force *force;
	int n = 0;

	incise_sim_config_init(&config);
	sim = incise_sim_new(&config, clock, NULL);
	force = incise_sim_force_new(sim);
	*start_ns = sim->start_ns;
	memset(log, 0, sizeof(*log));
	while (n < 2000) {
		incise_clock_wait_until(clock, incise_clock_now(clock) + 3000000);
		n += incise_force_read(force, log->force + n, 1000);
	}
	if (incise_force_lost(force))
		n = 0;
	force->ops->close(force);
	incise_sim_free(sim);
	incise_clock_free(clock);
	return n;
}

TEST(real_time_gives_the_same_samples)
{
	int64_t start_ns;
	int n;

	/* A machine that stands still for more than 2.5 s loses some: again. */
	do
		n = run_in_real_time(&second, &start_ns);
	while (!n);
	run(1, 4, &plain, &first);
	for (int i = 0; i < n; i++) {
		assert_int_equal(second.force[i].seq, i);
		assert_int_equal(second.force[i].code, first.force[i].code);
		assert_int_equal(second.force[i].t_ns - start_ns,
				 first.force[i].t_ns - START_NS);
	}
}

TEST(late_device_counts_from_0_in_the_same_world)
{
	struct incise_clock *clock = incise_clock_new_simulated(START_NS);
	struct incise_sim_config config;
	struct incise_sim_truth truth;
	struct incise_sim *sim;
	struct incise_force *force;
	int n;

	run(1, 4, &plain, &first);
	incise_sim_config_init(&config);
	sim = incise_sim_new(&config, clock, NULL);
	incise_clock_wait_until(clock, START_NS + 3 * INCISE_NS_PER_S);
	incise_sim_truth(sim, &truth); /* the world has gone on */
	force = incise_sim_force_new(sim);
	incise_clock_wait_until(clock, START_NS + 4 * INCISE_NS_PER_S);
	n = incise_force_read(force, second.force, MAX);
	assert_int_equal(n, 10000);
	for (int i = 0; i < n; i++) {
		assert_int_equal(second.force[i].seq, i);
		assert_int_equal(second.force[i].t_ns, first.force[30000 + i].t_ns);
		assert_int_equal(second.force[i].code, first.force[30000 + i].code);
	}
	assert_int_equal(incise_force_lost(force), 0);
	force->ops->close(force);
	incise_sim_free(sim);
	incise_clock_free(clock);
}

/* With withdrawal = paper in both directions, else where the blade cuts. */
static void look_at_truth(int withdrawal)
{
	struct incise_clock *clock = incise_clock_new_simulated(START_NS);
	struct incise_sim_config config;
	struct incise_sim_truth truth, before = {0};
	struct incise_sim *sim;
	int cutting = 0, law = 0;

	incise_sim_config_init(&config);
	config.tooth = 0;
	config.boundary = 0;
	config.withdrawal = withdrawal;
	sim = incise_sim_new(&config, clock, NULL);
	for (int64_t t = 0; t < 20 * INCISE_NS_PER_S; t += 1034567) {
		double moved, mean;

		incise_clock_wait_until(clock, START_NS + t);
		incise_sim_truth(sim, &truth);
		assert_int_equal(truth.t_ns, START_NS + t);
		assert_true(truth.depth_mm == fmax(0, -truth.position_mm[2]));
		/* 1e-15: two roundings of products with 1. */
		mean = incise_sim_mean_force(&config, truth.depth_mm,
					     truth.velocity_mm_s);
		law += mean > 0 && fabs(truth.force_N - mean) < 1e-15;
		assert_true(truth.force_N < mean + 1e-15 &&
			    truth.force_N > -config.friction * mean - 1e-15);
		cutting += mean > 0;
		moved = 0;
		for (int i = 0; i < 3; i++)
			moved += pow(truth.position_mm[i] - before.position_mm[i], 2);
		/* Way over 1 ms against the speeds at its ends: they differ by 3 mm/s at most
		   (3000 mm/s² in the pause's return). */
		if (t)
			assert_true(fabs(sqrt(moved) / 1034567e-9 -
					 (truth.velocity_mm_s + before.velocity_mm_s) /
						 2) < 3);
		before = truth;
	}
	assert_true(cutting > 10000); /* of 15 s in two cuts, the most */
	/* The surgeon's blade cuts nearly always: where it slows down, speeds up or rises, the
	   tissue unloads. */
	assert_true(withdrawal == INCISE_TISSUE_PAPER
			    ? law == cutting
			    : law > cutting * 3 / 4 && law < cutting);
	incise_sim_free(sim);
	incise_clock_free(clock);
}

TEST(truth_is_the_law_without_disturbance)
{
	look_at_truth(INCISE_TISSUE_PAPER);
	look_at_truth(INCISE_TISSUE_DISSIPATIVE);
}

TEST(bad_configuration_is_refused)
{
	struct incise_clock *clock = incise_clock_new_simulated(START_NS);
	struct incise_sim_config config;

	incise_sim_config_init(&config);
	config.force_hz = 0;
	assert_error(incise_sim_new(&config, clock, &err), EINVAL, &err,
		     "sim.force_hz:", "0");
	incise_sim_free(NULL);
	incise_clock_free(clock);
}

TEST(ring_keeps_order_and_counts_losses)
{
	struct incise_sim_ring ring;
	int next = 0, expected = 0, taken = 0;

	assert_int_equal(incise_sim_ring_init(&ring, sizeof(int), 4, 0.25), 0);
	/* 4 Hz for 2.5 s and 0.25 s more. */
	assert_true(ring.capacity >= 11);
	assert_null(incise_sim_ring_peek(&ring));
	/* Several rounds of more pushes than pops, then the rest. */
	for (int round = 0; round < 10; round++) {
		for (int i = 0; i < 7; i++, next++)
			incise_sim_ring_push(&ring, &next);
		for (int i = 0; i < 5; i++) {
			int value = *(const int *)incise_sim_ring_peek(&ring);

			/* Gaps only forward, and each one counted. */
			assert_true(value >= expected);
			expected = value + 1;
			taken++;
			incise_sim_ring_pop(&ring);
		}
	}
	while (incise_sim_ring_peek(&ring)) {
		expected = *(const int *)incise_sim_ring_peek(&ring) + 1;
		taken++;
		incise_sim_ring_pop(&ring);
	}
	assert_int_equal(expected, next); /* the newest is never dropped */
	assert_true(ring.lost > 0);
	assert_int_equal(taken + ring.lost, next);
	incise_sim_ring_free(&ring);
}
