// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of the haptic device of moteus drives: its lines, its limits, and every end of its torques.
 */
#include "../unit.h"
#include "../cases.h"
#include "../../../lib/base/vector.h"
#include "drives.h"

#define WATCHDOG_MS 50

static struct drives drives;
static struct incise_haptic *device;
static struct incise_haptic_setup setup;

static int open_bus(struct can_bus **bus, const struct can_bus_request *request,
		    struct incise_error *error)
{
	assert_string_equal(request->device, "can0");
	assert_true(request->fd && request->node == 128);
	*bus = &drives.bus;
	return 0;
}

static const struct can_transport transport = {.open = open_bus};

static struct incise_haptic *open_device(const char *arguments)
{
	struct incise_backend_request request = {
		.arguments = arguments, .where = "rig.conf:1: haptic", .haptic = &setup};

	device = moteus_open_on(&transport, &request, &err);
	return device;
}

/* Lines along x, y and 45 degrees between y and z: 10, 20 and 30 mm a turn. */
static int start(void **state)
{
	static const double directions[9] = {2, 0, 0, 0, 1, 0, 0, 1, 1};

	(void)state;
	drives_init(&drives, 3);
	setup = (struct incise_haptic_setup){
		.motor_mm_turn = {10, 20, 30},
		.motor_torque_N_mm = {100, 200, 300},
		.n_motor_directions = 9,
		.n_motors = 3,
		.n_motor_torques = 3,
	};
	memcpy(setup.motor_direction, directions, sizeof(directions));
	device = NULL;
	return 0;
}

static int end(void **state)
{
	(void)state;
	if (!device)
		return 0;
	device->ops->close(device);
	assert_true(drives.closed);
	for (int i = 0; i < drives.n; i++)
		assert_true(drives.drive[i].silent || drives.gone ||
			    drives.drive[i].mode == MOTEUS_STOPPED);
	return 0;
}

/* With one motor along x, 10 mm a turn. */
static void start_one(void)
{
	drives.n = 1;
	setup.n_motor_directions = 3;
	setup.n_motors = setup.n_motor_torques = 1;
	succeeds(open_device("can0:1"));
}

/* A tick of 1 ms: what an owner does. 1: there was a sample. */
static int tick(const double force_N[3], struct incise_haptic_sample *sample)
{
	static const double none[3];
	int rc = incise_haptic_read(device, sample, 1);

	if (rc < 0)
		return rc;
	if (incise_haptic_push(device, force_N, none) < 0)
		return -1;
	drives_advance(&drives, DRIVES_MS);
	return rc;
}

/* Ticks until the motors run. */
static void run(struct incise_haptic_sample *sample)
{
	static const double none[3];

	for (int i = 0; i < 100; i++)
		if (tick(none, sample) == 1 && !sample->flags)
			return;
	fail_msg("it never is ready: flags %u", sample->flags);
}

static void assert_cause(const char *expected)
{
	char text[300];

	assert_true(incise_haptic_cause(device, text, sizeof(text)) > 0);
	if (!strstr(text, expected))
		fail_msg("\"%s\" is not in \"%s\"", expected, text);
}

static void assert_no_torque(void)
{
	for (int i = 0; i < drives.n; i++)
		assert_true(drives.drive[i].mode != MOTEUS_POSITION ||
			    drives.drive[i].torque == 0);
}

/* Ticks with a force until it fails, or a flag other than readiness comes. */
static int until_trouble(struct incise_haptic_sample *sample, int *ticks)
{
	static const double force_N[3] = {1, 0, 0};
	int rc = 0;

	for (*ticks = 0; *ticks < 100; ++*ticks) {
		rc = tick(force_N, sample);
		if (rc < 0 || (rc == 1 && sample->flags & ~INCISE_HAPTIC_NOT_READY))
			break;
	}
	return rc;
}

TEST(words, start, end)
{
	static const char *const bad[] = {
		"",
		"can0",
		"can0:",
		":1",
		"can0:0",
		"can0:128",
		"can0:1,",
		"can0:1,2,3,4",
		"can0:1,2,1",
		"can0:1 ",
		"can0:x",
		"can0:1:2",
		"a_name_of_an_interface_that_is_much_too_long:1,2,3"};

	for (size_t i = 0; i < sizeof(bad) / sizeof(*bad); i++) {
		assert_null(open_device(bad[i]));
		assert_int_equal(errno, EINVAL);
		assert_non_null(strstr(err.text, "moteus:can0:1,2,3"));
	}
	assert_null(open_device("can0:1,2"));
	assert_non_null(strstr(err.text, "motor_torque_N_mm of 2 motors, not of 3"));
	setup.motor_direction[7] = 0.1;
	setup.motor_direction[8] = 0.05;
	assert_null(open_device("can0:1,2,3"));
	assert_non_null(strstr(err.text, "30 degrees"));
	memset(setup.motor_direction, 0, sizeof(setup.motor_direction));
	assert_null(open_device("can0:1,2,3"));
}

TEST(properties, start, end)
{
	struct incise_haptic_info info = {0};

	succeeds(open_device("can0:1,2,3"));
	incise_haptic_info(device, &info);
	/* |dual| of x, y, z': 1, √2, √2; 20 π N each */
	assert_float_equal(info.peak_N, 20 * M_PI / sqrt(2), 1e-9);
	assert_true(info.deadman_s == WATCHDOG_MS * 1e-3 && info.rate_hz == 1000);
	assert_true(info.features == INCISE_HAPTIC_PAGE_VELOCITY &&
		    info.latency_ns == DRIVES_MS);
	assert_string_equal(info.name, "3 moteus on can0");
	/* the test of the watchdogs had no torque, and left them stopped */
	for (int i = 0; i < 3; i++)
		assert_true(drives.drive[i].mode == MOTEUS_STOPPED &&
			    drives.drive[i].stops == 2 && drives.drive[i].most == 0 &&
			    drives.drive[i].watchdog == (float)(WATCHDOG_MS * 1e-3));
}

TEST(positions_of_three_lines, start, end)
{
	struct incise_haptic_sample sample;
	double along[3];

	drives.drive[0].position = 0.1f;
	drives.drive[1].position = -0.25f;
	drives.drive[2].position = 1 / 3.f;
	drives.drive[2].velocity = 2.5f;
	succeeds(open_device("can0:1,2,3"));
	run(&sample);
	along[0] = sample.position_mm[0];
	along[1] = sample.position_mm[1];
	along[2] = (sample.position_mm[1] + sample.position_mm[2]) / sqrt(2);
	assert_true(along[0] == 0.1f * 10.);
	assert_float_equal(along[1], -0.25 * 20, 1e-12);
	assert_float_equal(along[2], (double)(1 / 3.f) * 30, 1e-12);
	assert_float_equal((sample.velocity_mm_s[1] + sample.velocity_mm_s[2]) / sqrt(2),
			   2.5 * 30, 1e-12);
	assert_true(sample.quaternion[0] == 1 && !sample.buttons);
	/* between question and answer of a tick ago */
	assert_int_equal(drives.now_ns - sample.t_ns,
			 2 * DRIVES_MS - drives.drive[0].latency_ns / 2);
	assert_int_equal(incise_haptic_lost(device), 0);
}

TEST(torques_are_the_force, start, end)
{
	static const double force_N[3] = {3, -2, 5};
	static const double directions[3][3] = {
		{1, 0, 0}, {0, 1, 0}, {0, M_SQRT1_2, M_SQRT1_2}};
	struct incise_haptic_sample sample;
	double felt_N[3] = {0};

	succeeds(open_device("can0:1,2,3"));
	run(&sample);
	tick(force_N, &sample);
	for (int i = 0; i < 3; i++) {
		assert_true(drives.drive[i].most ==
			    (float)(setup.motor_torque_N_mm[i] * 1e-3));
		v3_add(felt_N, felt_N,
		       (double)drives.drive[i].torque * 1e3 * 2 * M_PI /
			       setup.motor_mm_turn[i],
		       directions[i]);
	}
	for (int k = 0; k < 3; k++)
		assert_float_equal(felt_N[k], force_N[k], 1e-6);
}

TEST(a_torque_beyond_a_motor_keeps_the_direction, start, end)
{
	static const double force_N[3] = {1000, 0, 1};
	struct incise_haptic_sample sample;

	succeeds(open_device("can0:1,2,3"));
	run(&sample);
	tick(force_N, &sample);
	assert_true(drives.drive[0].torque == 0.1f);
	/* 20 π N along x for 1000, and so √2 of 20 π / 1000 N along the third line */
	assert_float_equal(drives.drive[2].torque,
			   20 * M_PI / 1000 * M_SQRT2 * 30 / (2 * M_PI) * 1e-3, 1e-9);
}

TEST(one_motor, start, end)
{
	static const double force_N[3] = {2, 7, 7};
	struct incise_haptic_sample sample;

	drives.drive[0].position = -1.5f;
	start_one();
	run(&sample);
	assert_true(sample.position_mm[0] == -15 && sample.position_mm[1] == 0);
	tick(force_N, &sample);
	assert_true(drives.drive[0].torque == (float)(2 * 10 / (2 * M_PI) * 1e-3));
}

static int keep_found(void *context, const struct incise_scan_device *drive)
{
	snprintf((char *)context + strlen(context), 600, "%s %d %s\n", drive->device,
		 drive->usable, drive->what);
	return 0;
}

TEST(a_search_asks_each_id_once, start, end)
{
	int64_t before_ns = drives.now_ns;
	char list[3000] = "";

	drives.n = 4;
	drives.drive[0].id = 127;
	drives.drive[1].id = 5;
	drives.drive[1].refused = 0x1f;
	drives.drive[2].id = drives.drive[3].id = 9;
	drives.drive[2].latency_ns = drives.drive[3].latency_ns = 15 * DRIVES_MS;
	drives.drive[3].voltage = 48;
	assert_int_equal(moteus_scan_on(&transport, "can0", keep_found, list, &err), 0);
	assert_string_equal(
		list, "moteus:can0:5 0 moteus drive: refuses a query; update its "
		      "firmware\n"
		      "moteus:can0:9 0 moteus drive: another one has this id; give "
		      "each its own\n"
		      "moteus:can0:127 1 moteus drive, mode 0, no fault, 24 V, 31 C\n");
	assert_true(drives.closed && drives.now_ns - before_ns < 200 * DRIVES_MS);
	/* Nobody acknowledges a frame. */
	drives.full = true;
	*list = 0;
	assert_int_equal(moteus_scan_on(&transport, "can0", keep_found, list, &err), 0);
	assert_string_equal(list, "");
	assert_no_torque();
}

TEST(refused_at_the_start, start, end)
{
	static const struct {
		int code;
		const char *text;
	} cases[] = {
		{ETIMEDOUT, "no answer of motor 2"},
		{EPROTO, "two motors on can0 have the id 2"},
		{EPROTO, "motor 2 refuses register 0x027"},
		{EPROTO, "motor 2 does not start, and stop by its watchdog 50 ms later: "
			 "mode 10, no fault"},
		{EPROTO, "motor 2 gives no position"},
		{EPROTO, "later: mode 0, no fault"},
		{ENODEV, "can0: Network is down"},
	};

	for (int i = 0; i < (int)(sizeof(cases) / sizeof(*cases)); i++) {
		start(NULL);
		drives.drive[1].silent = i == 0;
		drives.n += i == 1;
		drives.drive[3] = drives.drive[1];
		drives.drive[1].refused = i == 2 ? 0x27 : 0;
		drives.drive[1].no_watchdog = i == 3;
		drives.drive[1].position = i == 4 ? NAN : 0;
		drives.drive[1].lame = i == 5;
		drives.gone = i == 6 ? -ENETDOWN : 0;
		assert_null(open_device("can0:1,2,3"));
		assert_int_equal(errno, cases[i].code);
		if (!strstr(err.text, cases[i].text))
			fail_msg("%s", err.text);
		assert_true(drives.closed);
		assert_no_torque();
	}
}

/* An owner that pauses finds its motors stopped by themselves, and starts them again. */
TEST(a_pause, start, end)
{
	static const double force_N[3] = {1, 0, 0};
	struct incise_haptic_sample sample;
	int off = 0;

	start_one();
	run(&sample);
	tick(force_N, &sample);
	assert_true(drives.drive[0].torque > 0);
	drives_advance(&drives, (WATCHDOG_MS + 1) * DRIVES_MS);
	assert_int_equal(drives.drive[0].mode, MOTEUS_TIMEOUT);
	drives.drive[0].position += 3; /* by a hand, meanwhile */
	tick(force_N, &sample);
	for (; tick(force_N, &sample) == 1 && sample.flags; off++)
		assert_no_torque();
	assert_int_equal(sample.flags, 0);
	assert_in_range(off, 28, 32);
	assert_true(drives.drive[0].torque > 0);
}

TEST(faults, start, end)
{
	struct incise_haptic_sample sample;
	int ticks;

	succeeds(open_device("can0:1,2,3"));
	run(&sample);
	drives.drive[1].mode = MOTEUS_FAULT;
	drives.drive[1].fault = 38;
	drives.drive[1].temperature = 76;
	assert_int_equal(until_trouble(&sample, &ticks), 1);
	assert_in_range(ticks, 0, 2);
	assert_true(sample.flags & INCISE_HAPTIC_PROTECTED);
	assert_no_torque();
	assert_cause("motor 2: fault 38, over temperature (76 C, 24 V)");
	/* positions go on, without force */
	drives.drive[0].position += 0.01f;
	assert_int_equal(until_trouble(&sample, &ticks), 1);
	assert_int_equal(until_trouble(&sample, &ticks), 1);
	assert_true(sample.position_mm[0] > 0.09);
	assert_no_torque();
}

TEST(a_stop_that_found_no_place_is_repeated, start, end)
{
	static const double force_N[3] = {1, 0, 0};
	struct incise_haptic_sample sample;

	succeeds(open_device("can0:1,2,3"));
	run(&sample);
	tick(force_N, &sample);
	drives.drive[1].mode = MOTEUS_FAULT;
	drives.drive[1].fault = 38;
	tick(force_N, &sample);
	drives.full = true;
	tick(force_N, &sample);
	assert_cause("motor 2: fault 38");
	assert_true(drives.drive[0].torque > 0);
	drives.full = false;
	tick(force_N, &sample);
	for (int i = 0; i < 3; i++)
		assert_int_equal(drives.drive[i].mode, MOTEUS_STOPPED);
	/* Positions go on. */
	assert_int_equal(tick(force_N, &sample), 1);
}

TEST(positions_that_jump, start, end)
{
	struct incise_haptic_sample sample;
	int ticks;

	start_one();
	run(&sample);
	/* as fast as it says */
	drives.drive[0].velocity = 400;
	tick((double[3]){1}, &sample);
	drives.drive[0].position = 0.6f;
	tick((double[3]){1}, &sample);
	tick((double[3]){1}, &sample);
	assert_int_equal(sample.flags, 0);
	drives.drive[0].velocity = 0;
	until_trouble(&sample, &ticks);
	assert_int_equal(ticks, 100);
	drives.drive[0].position = 0;
	assert_int_equal(until_trouble(&sample, &ticks), 1);
	assert_in_range(ticks, 0, 2);
	assert_true(sample.flags & INCISE_HAPTIC_CHANGED);
	assert_cause("jumped from 0.6 to 0 turns");
	assert_no_torque();
}

TEST(a_motor_that_restarts, start, end)
{
	struct incise_haptic_sample sample;
	int ticks;

	start_one();
	run(&sample);
	drives.drive[0].mode = MOTEUS_STOPPED;
	drives.drive[0].lame = true;
	assert_int_equal(until_trouble(&sample, &ticks), 1);
	assert_true(sample.flags & INCISE_HAPTIC_CHANGED);
	assert_cause("has restarted");
}

TEST(positions_that_are_not_numbers, start, end)
{
	struct incise_haptic_sample sample;
	int ticks;

	drives.drive[0].position = 0.2f;
	start_one();
	run(&sample);
	drives.drive[0].position = NAN;
	assert_int_equal(until_trouble(&sample, &ticks), 1);
	assert_true(sample.flags & INCISE_HAPTIC_PROTECTED);
	assert_true(sample.position_mm[0] == 0.2f * 10.);
	assert_cause("gives no position");
	assert_no_torque();
}

TEST(a_hot_motor_is_said, start, end)
{
	struct incise_haptic_sample sample;
	int ticks;

	start_one();
	run(&sample);
	drives.drive[0].fault = 100;
	assert_int_equal(until_trouble(&sample, &ticks), 1);
	assert_int_equal(sample.flags, INCISE_HAPTIC_PROTECTED);
	drives.drive[0].fault = 102; /* the largest torque is ours */
	run(&sample);
}

TEST(a_silent_motor_ends_all, start, end)
{
	struct incise_haptic_sample sample;
	int ticks;

	succeeds(open_device("can0:1,2,3"));
	run(&sample);
	drives.drive[1].silent = true;
	for (int i = 0; i < 4; i++)
		tick((double[3]){1, 1, 1}, &sample);
	assert_no_torque(); /* already */
	assert_int_equal(until_trouble(&sample, &ticks), -EIO);
	assert_in_range(ticks, 5, 9);
	assert_cause("motor 2 does not answer");
	for (int i = 0; i < 3; i++)
		assert_int_equal(drives.drive[i].mode, MOTEUS_STOPPED);
	assert_int_equal(incise_haptic_push(device, (double[3]){0}, (double[3]){0}),
			 -EIO);
}

/* A lost answer, and answers later than a tick, are no end. */
TEST(answers_that_are_lost_or_late, start, end)
{
	struct incise_haptic_sample sample;
	uint64_t seq;

	start_one();
	run(&sample);
	seq = sample.seq;
	drives.drive[0].silent = true;
	tick((double[3]){1}, &sample);
	drives.drive[0].silent = false;
	assert_int_equal(tick((double[3]){1}, &sample), 0);
	assert_int_equal(tick((double[3]){1}, &sample), 1);
	assert_int_equal(sample.seq, seq + 3);
	assert_int_equal(incise_haptic_lost(device), 1);
	drives.drive[0].latency_ns = 3 * DRIVES_MS / 2;
	for (int i = 0; i < 50; i++)
		assert_true(tick((double[3]){1}, &sample) >= 0);
	assert_int_equal(sample.flags, 0);
	/* of the push before, whose answer came a quarter of a tick ago by the last read */
	assert_int_equal(drives.now_ns - sample.t_ns,
			 DRIVES_MS + DRIVES_MS / 2 + DRIVES_MS / 8);
	drives.drive[0].latency_ns = 20 * DRIVES_MS;
	for (int i = 0; i < 20 && tick((double[3]){1}, &sample) >= 0; i++)
		;
	assert_cause("does not answer");
	assert_no_torque();
}

TEST(a_bus_that_ends, start, end)
{
	struct incise_haptic_sample sample;
	int ticks;

	start_one();
	run(&sample);
	drives.gone = -ENETDOWN;
	assert_int_equal(until_trouble(&sample, &ticks), -ENODEV);
	assert_cause("can0: Network is down");
}

TEST(a_full_queue_is_silence, start, end)
{
	struct incise_haptic_sample sample;
	int ticks;

	start_one();
	run(&sample);
	drives.full = true;
	assert_int_equal(until_trouble(&sample, &ticks), -EIO);
	assert_cause("does not answer");
	drives.full = false;
}

/* Poses are numbers and torques within the largest, whatever the drives answer. */
TEST(mutated_answers, start, NULL)
{
	int n = cases_of(100000, 0);
	struct incise_haptic_sample sample;

	for (int i = 0; i < n;) {
		unsigned int seed = drives.seed;

		start(NULL);
		drives.seed = seed + 1;
		succeeds(open_device("can0:1,2,3"));
		run(&sample);
		drives.drive[i % 3].mutates = true;
		for (int rc = 0, k = 0; rc >= 0 && k < 50; i++, k++) {
			rc = tick((double[3]){100, -50, 30}, &sample);
			assert_true(rc < 1 || v3_finite(sample.position_mm));
			for (int d = 0; d < 3; d++)
				assert_true(fabsf(drives.drive[d].torque) <=
					    (float)(setup.motor_torque_N_mm[d] * 1e-3));
		}
		end(NULL);
	}
}
