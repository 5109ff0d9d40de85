// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/rig/haptic_gate.c: the force of an owner over random histories of a user's half, against the rules of
 * doc/haptic-page.md said once more.
 */
#include "../unit.h"
#include "../cases.h"
#include "../../../lib/base/random.h"
#include "../../../lib/base/vector.h"
#include "../../../lib/rig/haptic_page.h"

#define PEAK_N 3.0
#define TORQUE_N_mm 50.0
#define MS 1000000

static const struct incise_haptic_page_user good = {
	.seq = 2,
	.wants = INCISE_HAPTIC_PAGE_FORCE,
	.heartbeat_ns = 1000 * MS,
	.period_ns = MS,
	.force_N = {1, -2, 0.5},
	.torque_N_mm = {0, 30, 0},
};

static const struct haptic_gate fresh = {.peak_N = PEAK_N, .torque_N_mm = TORQUE_N_mm};

/* Go through the ramp, from its step @from, with a good half each ms; returns the time. */
static int64_t go_to_full(struct haptic_gate *gate, struct incise_haptic_page_user *half,
			  int from)
{
	double force_N[3], torque_N_mm[3];

	for (int i = from; i <= 101; i++) {
		half->heartbeat_ns += MS;
		half->seq += 2;
		assert_null(incise_haptic_gate(gate, half, half->heartbeat_ns, force_N,
					       torque_N_mm));
		assert_true(fabs(force_N[1] - -2 * fmin(1, i / 100.0)) < 1e-9);
		assert_true(fabs(torque_N_mm[1] - 30 * fmin(1, i / 100.0)) < 1e-9);
	}
	return half->heartbeat_ns;
}

TEST(each_fault_gives_no_force_and_a_ramp_follows)
{
	static const struct {
		const char *why;
		uint32_t wants;
		double force_N;
		int64_t beat_ns, period_ns; /* the beat from now */
		int seq;
	} rows[] = {
		{"off", 0, 1, 0, MS, 2},
		{"off", 2, 1, 0, MS, 2},
		{"invalid", 3, 1, 0, MS, 2},
		{"invalid", 1, NAN, 0, MS, 2},
		{"invalid", 1, INFINITY, 0, MS, 2},
		{"invalid", 1, 1, 0, 0, 2},
		{"invalid", 1, 1, 0, -MS, 2},
		{"invalid", 1, 1, 0, INCISE_HAPTIC_PAGE_PERIOD_NS + 1, 2},
		{"time", 1, 1, 1, MS, 2},
		{"time", 1, 1, INT64_MIN / 2, MS, 2},
		{"late", 1, 1, -2 * MS - 1, MS, 2},
		{"back", 1, 1, 0, MS, -2},
	};

	for (size_t i = 0; i < sizeof(rows) / sizeof(*rows); i++) {
		struct haptic_gate gate = fresh;
		struct incise_haptic_page_user half = good, bad;
		int64_t now_ns = go_to_full(&gate, &half, 0);
		double force_N[3], torque_N_mm[3];
		const char *why;

		bad = half;
		bad.wants = rows[i].wants;
		bad.force_N[0] = rows[i].force_N;
		bad.heartbeat_ns = now_ns + MS + rows[i].beat_ns;
		bad.period_ns = rows[i].period_ns;
		bad.seq += (uint32_t)rows[i].seq;
		why = incise_haptic_gate(&gate, &bad, now_ns + MS, force_N, torque_N_mm);
		assert_non_null(why);
		assert_string_equal(why, rows[i].why);
		assert_true(v3_length(force_N) == 0 && v3_length(torque_N_mm) == 0);
		half.heartbeat_ns += MS;
		half.seq = gate.last.seq;
		go_to_full(&gate, &half, 1);
	}
}

TEST(a_torn_half_keeps_the_force_for_a_period_and_fades_in_the_next)
{
	struct haptic_gate gate = fresh;
	struct incise_haptic_page_user half = good;
	int64_t now_ns = go_to_full(&gate, &half, 0);
	double force_N[3], torque_N_mm[3];

	for (int i = 1; i <= 30; i++) {
		assert_string_equal(incise_haptic_gate(&gate, NULL, now_ns + i * MS / 10,
						       force_N, torque_N_mm),
				    "torn");
		assert_true(fabs(force_N[0] - fmin(1, fmax(0, 2 - i / 10.0))) < 1e-9);
	}
	/* and it comes back by the ramp, from where it was */
	gate = fresh;
	half = good;
	now_ns = go_to_full(&gate, &half, 0);
	incise_haptic_gate(&gate, NULL, now_ns + MS * 3 / 2, force_N, torque_N_mm);
	assert_true(fabs(force_N[0] - 0.5) < 1e-9);
	half.heartbeat_ns += 2 * MS;
	half.seq += 2;
	incise_haptic_gate(&gate, &half, now_ns + 2 * MS, force_N, torque_N_mm);
	assert_true(fabs(force_N[0] - 0.505) < 1e-9);
}

TEST(an_owner_that_stood_still_begins_from_zero)
{
	struct haptic_gate gate = fresh;
	struct incise_haptic_page_user half = good;
	double force_N[3], torque_N_mm[3];

	half.heartbeat_ns = go_to_full(&gate, &half, 0) + 21 * MS;
	half.seq += 2;
	assert_null(incise_haptic_gate(&gate, &half, half.heartbeat_ns, force_N,
				       torque_N_mm));
	assert_true(v3_length(force_N) == 0);
}

/* A number, at times one that is none, or large. */
static double draw_number(uint64_t key, uint64_t *n)
{
	static const double odd[] = {NAN, INFINITY, -INFINITY, 1e308, -1e308, 0};

	if (incise_random_bits(key, (*n)++) % 50 == 0)
		return odd[incise_random_bits(key, (*n)++) % 6];
	return 20 * incise_random_uniform(key, (*n)++) - 10;
}

TEST(no_history_gives_a_wrong_force)
{
	uint64_t key = cases_seed(1), n = 0, seen = 0, zero = 0;
	int all = cases_of(2000, 100);

	for (int k = 0; k < all; k++) {
		struct haptic_gate gate = fresh;
		struct incise_haptic_page_user half = good, last = {0};
		double share = 0;
		int64_t now_ns = 1000 * MS, before_ns = 0;

		for (int i = 0; i < 400; i++) {
			bool torn = incise_random_bits(key, n++) % 40 == 0;
			bool misses = incise_random_bits(key, n++) % 20 == 0;
			double force_N[3], torque_N_mm[3], length, periods;
			const char *why;

			now_ns += (int64_t)(incise_random_uniform(key, n++) * 2 * MS);
			if (!misses) {
				half.heartbeat_ns = now_ns - MS / 2;
				half.seq += 2;
				for (int j = 0; j < 3; j++) {
					half.force_N[j] = draw_number(key, &n);
					half.torque_N_mm[j] = 10 * draw_number(key, &n);
				}
				half.wants =
					incise_random_bits(key, n++) % 60
						? 1
						: (uint32_t)incise_random_bits(key, n++) %
							  4;
			}
			why = incise_haptic_gate(&gate, torn ? NULL : &half, now_ns,
						 force_N, torque_N_mm);
			length = v3_length(force_N);
			assert_true(v3_finite(force_N) && v3_finite(torque_N_mm));
			assert_true(length <= PEAK_N * (1 + 1e-12));
			assert_true(v3_length(torque_N_mm) <= TORQUE_N_mm * (1 + 1e-12));
			if (!torn && v3_finite(half.force_N) &&
			    v3_finite(half.torque_N_mm) && half.wants < 3)
				last = half;
			periods = (double)(now_ns - last.heartbeat_ns) / MS;
			if (periods > 2 || last.wants != 1 ||
			    (!torn && memcmp(&last, &half, sizeof(half))))
				assert_true(length == 0);
			if (periods > 2 || (!torn && (why != NULL)))
				assert_true(length == 0 && why);
			/* it rises by the ramp alone */
			assert_true(gate.share >= 0 &&
				    gate.share <= share +
							  (double)(now_ns - before_ns) /
								  (100 * MS) +
							  1e-12);
			share = gate.share;
			before_ns = now_ns;
			seen += length > 0;
			zero += length == 0;
		}
	}
	assert_true(seen > (uint64_t)all * 100 && zero > (uint64_t)all * 20);
}
