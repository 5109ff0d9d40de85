// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/can/cia402/can_units.c: rig.conf in the units of a drive, compared with
 * figures made by hand; the load of the bus, with frames that are stuffed here bit by bit.
 */
#include "../unit.h"
#include "../../../lib/device/can/cia402/can_units.h"
#include "rig.h"

/* 4 mm a turn; 10 mm/s are 2.5 turns/s, 500 mm/s² are 125. */
static void make(struct can_session *session, double counts_per_turn,
		 struct incise_error *err)
{
	static struct can_rig rig;

	can_rig_init(&rig);
	*session = (struct can_session){
		.bus = &rig.drive.bus,
		.actuator = rig.actuator,
		.units = {counts_per_turn, 60, 60},
	};
	session->master.bus = session->bus;
	session->client = (struct cia402_client){&session->master, "here", err};
}

TEST(steps_are_as_fine_as_may_be)
{
	static const struct {
		double counts_per_turn, velocity_mm_s;
		int steps_per_turn;
	} cases[] = {
		{51200, 10, 51200},
		{3600, 10, 3600},
		{0.5, 10, 1},
		{2000.7, 10, 2000},
		/* 150000 steps/s at the most: 60000 of 2.5 turns/s, 1500 of 100. */
		{131072, 10, 60000},
		{1e9, 10, 60000},
		{51200, 400, 1500},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct can_session session;

		make(&session, cases[i].counts_per_turn, &err);
		session.actuator.velocity_mm_s = cases[i].velocity_mm_s;
		can_units_steps(&session);
		assert_int_equal(session.actuator.steps_per_turn,
				 cases[i].steps_per_turn);
		can_units_setup(&session);
		assert_int_equal(can_units_axis(&session), 0);
		/* A turn stays a turn in any units. */
		assert_true(fabs(session.axis.setup.counts_per_step *
					 cases[i].steps_per_turn -
				 cases[i].counts_per_turn) <=
			    1e-9 * cases[i].counts_per_turn);
	}
}

TEST(limits_are_the_drives_with_room)
{
	struct can_session session;

	make(&session, 51200, &err);
	can_units_steps(&session);
	can_units_setup(&session);
	assert_int_equal(can_units_axis(&session), 0);
	/* In rpm: 150 and 7500 rpm/s, and a quarter more. */
	assert_int_equal(session.setup.velocity, 188);
	assert_int_equal(session.setup.acceleration, 9375);
	assert_int_equal(session.setup.following, 12800);
	assert_int_equal(session.setup.following_ms, 50);
	assert_int_equal(session.setup.deadman_ms, 100);
	assert_int_equal(session.setup.heartbeat_ms, 25);
	can_units_range(&session);
	assert_int_equal(session.setup.position_min, INT32_MIN);
	assert_int_equal(session.setup.position_max, INT32_MAX);
	session.is_homed = true;
	session.axis.zero_counts = 6400;
	can_units_range(&session);
	assert_int_equal(session.setup.position_min, 6400 - 12800);
	assert_int_equal(session.setup.position_max, 6400 + 21 * 12800);
	/* Inverted, with a home below 0. */
	session.actuator.invert = true;
	session.actuator.home_mm = -2;
	assert_int_equal(can_units_axis(&session), 0);
	can_units_range(&session);
	assert_int_equal(session.setup.position_min, 6400 - 21 * 12800);
	assert_int_equal(session.setup.position_max, 6400 + 3 * 12800);
	assert_int_equal(session.axis.setup.config.position_min, -2 * 12800);
	/* A jerk that would take more ticks than the profile has. */
	session.actuator.jerk_mm_s3 = 1;
	assert_int_equal(can_units_axis(&session), -ERANGE);
	assert_non_null(strstr(err.text, "jerk_mm_s3"));
}

/* 1 kHz fits at 500 kbit/s, not at 250. */
TEST(a_bus_that_is_too_slow_is_refused)
{
	static const struct {
		uint32_t bitrate, cycle_ns;
		bool fits;
	} cases[] = {
		{500000, 1000000, true}, {250000, 1000000, false},
		{1000000, 500000, true}, {500000, 500000, false},
		{250000, 2000000, true}, {125000, 2000000, false},
		{10000, 2000000, false}, {0, 500000, true},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_error err = {0};
		struct can_session session;
		int rc;

		make(&session, 51200, &err);
		session.bus->bitrate = cases[i].bitrate;
		session.actuator.can.cycle_ns = cases[i].cycle_ns;
		can_units_steps(&session);
		can_units_setup(&session);
		rc = can_units_load(&session);
		if (rc != (cases[i].fits ? 0 : -ERANGE))
			fail_msg("case %zu: %d, %u %%", i, rc, session.load_percent);
		assert_int_equal(!*err.text, cases[i].fits);
		assert_int_equal(!session.load_percent, !cases[i].bitrate);
	}
}

/* The longest frame: a run of 5 equal bits, then runs of 4 with each stuffed bit. */
static uint32_t stuffed_by_hand(unsigned int bytes)
{
	unsigned int bits = 1 + 11 + 1 + 1 + 1 + 4 + 8 * bytes + 15, run = 0, sent = 0;
	int last = -1, next = 0;

	for (unsigned int i = 0; i < bits; i++) {
		/* The worst case repeats the last bit on the wire. */
		run = next == last ? run + 1 : 1;
		last = next;
		sent++;
		if (run == 5) {
			last = !last;
			run = 1;
			sent++;
			next = last;
		}
	}
	return sent + 1 + 1 + 1 + 7 + 3; /* delimiters, acknowledge, end, gap */
}

TEST(the_load_is_that_of_stuffed_frames)
{
	static const struct {
		uint32_t cycle_ns;
		unsigned int rpdo, tpdo;
		int64_t heartbeat_ns;
		uint32_t load;
	} cases[] = {
		/* SYNC 55, two of 8 bytes 135 each, at 1 kHz; inputs 95 bits at 100 Hz. */
		{1000000, 8, 8, 0, 325000 + 9500},
		/* Heartbeats of 65 bits, ten a second each way. */
		{1000000, 8, 8, 100000000, 325000 + 9500 + 1300},
		{2000000, 6, 6, 0, 285000 / 2 + 9500},
		{0, 8, 8, 1, UINT32_MAX},
		{1, 8, 8, 1, UINT32_MAX},
		{UINT32_MAX, 0, 0, INT64_MAX, 39 + 9500 + 1},
		{UINT32_MAX, 0, 0, -1, 39 + 9500},
	};

	for (unsigned int bytes = 0; bytes <= 8; bytes++)
		assert_int_equal(bus_load_bits(bytes), stuffed_by_hand(bytes));
	assert_int_equal(bus_load_bits(9), 135);
	assert_int_equal(bus_load_bits(UINT32_MAX), 135);
	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++)
		assert_int_equal(bus_load_of(cases[i].cycle_ns, cases[i].rpdo,
					     cases[i].tpdo, cases[i].heartbeat_ns),
				 cases[i].load);
}

TEST(whole_units)
{
	assert_int_equal(can_units_whole(0), 1);
	assert_int_equal(can_units_whole(0.2), 1);
	assert_int_equal(can_units_whole(1.2), 2);
	assert_int_equal(can_units_whole(1e300), UINT32_MAX);
}
