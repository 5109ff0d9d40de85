// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/polhemus/polhemus_setup.c and polhemus_dialogue.c with the emulator: the settings
 * that it gets, and the message for each that it does not take.
 */
#include "../unit.h"
#include "../../../lib/device/polhemus/polhemus_setup.h"
#include "line.h"

static struct emulator e;
static struct test_line line;
static struct polhemus_identity identity;
static struct incise_error err;

static int end(void **state)
{
	emulator_free(&e);
	return 0;
}

static int set_up(const struct incise_tracker_setup *setup)
{
	memset(&err, 0, sizeof(err));
	return polhemus_setup(&line.line, setup, &identity, "rig.conf:3: tracker", &err);
}

static void begin(enum emulator_kind kind, int family)
{
	const char *streams;

	emulator_free(&e);
	emulator_init(&e, kind, 0);
	test_line_init(&line, &e, family);
	/* It streams in its own format when somebody left it so. */
	streams = kind == EMULATOR_FASTRAK ? "I1,0\rfC" : "F1\rC\r";
	emulator_write(&e, streams, strlen(streams));
}

static const struct incise_tracker_setup first = {
	.n_stations = 1, .stations = {1}, .hemisphere = {1, 0, 0}};
static const struct incise_tracker_setup two = {
	.n_stations = 2, .stations = {1, 2}, .hemisphere = {0, 0.6, -0.8}};

TEST(all_is_set, NULL, end)
{
	static const struct {
		enum emulator_kind kind;
		int family; /* -1: it is asked */
		int switch_bytes;
		const struct incise_tracker_setup *setup;
		size_t length;
	} cases[] = {
		{EMULATOR_FASTRAK, POLHEMUS_FASTRAK, 1, &first, 34},
		{EMULATOR_FASTRAK, -1, 1, &two, 34},
		{EMULATOR_FASTRAK, -1, 2, &two, 35},
		{EMULATOR_FASTRAK, -1, 4, &two, 37},
		{EMULATOR_LIBERTY, POLHEMUS_LIBERTY, 4, &two, 44},
		{EMULATOR_LIBERTY, -1, 4, &first, 44},
		{EMULATOR_PATRIOT, -1, 4, &two, 44},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		const struct incise_tracker_setup *s = cases[i].setup;

		begin(cases[i].kind, cases[i].family);
		e.present[1] = true;
		/* A station that is to be off. */
		e.on[1] = s->n_stations == 1;
		e.switch_bytes = cases[i].switch_bytes;
		if (set_up(s))
			fail_msg("case %zu: %s", i, err.text);
		assert_int_equal(identity.layout.family, cases[i].kind);
		assert_int_equal(polhemus_layout_length(&identity.layout),
				 cases[i].length);
		assert_true(e.binary && e.cm && e.continuous && e.mouse);
		assert_true(e.on[0] && e.on[1] == (s->n_stations == 2) && !e.on[2] &&
			    !e.on[3]);
		for (int k = 0; k < s->n_stations; k++) {
			if (cases[i].kind == EMULATOR_FASTRAK)
				assert_true(e.increment[k] == 0);
			/* Four digits are sent. */
			for (int j = 0; j < 3; j++)
				assert_float_equal(e.hemisphere[k][j], s->hemisphere[j],
						   1e-4);
		}
		for (int f = 0; f < 2; f++)
			assert_true(e.filters[f][0] == 0 && e.filters[f][1] == 1);
		assert_int_equal(e.eeprom_writes, 0);
		assert_null(memchr(line.said, 'K' & 31, line.n_said));
		if (cases[i].kind == EMULATOR_FASTRAK) {
			assert_int_equal(identity.sensors, 3);
			assert_string_equal(identity.name, "FASTRAK 3.02 OutputCompensat "
							   "CPG2030-003-10");
		} else {
			assert_non_null(strstr(identity.name, "SN 1234"));
		}
		polhemus_stop(&line.line, identity.layout.family);
		assert_false(e.continuous);
	}
}

/* The setup reads the settings that another program left, of each station in use, and changes none. */
TEST(settings_that_alter_poses, NULL, end)
{
	static const struct {
		enum emulator_kind kind;
		double origin, along_x, roll, tip, elevation; /* of station 2 */
		const char *note;
	} cases[] = {
		{EMULATOR_FASTRAK, 0, 200, 0, 0, 0, ""},
		{EMULATOR_FASTRAK, 0, 1, 0, 0, 0, ""},
		{EMULATOR_FASTRAK, 0, -200, 0, 0, 0, "poses: A2 0 0 0 -200 0 0 0 200 0"},
		{EMULATOR_FASTRAK, -100.25, 200, 0, 0, 0, "A2 -100.25 0 0 200 "},
		{EMULATOR_FASTRAK, 0, 200, -180, 1.25, -15,
		 "poses: r2 0 0 -180; G2 0 -15 0; N2 1.25 0 0"},
		{EMULATOR_LIBERTY, 0, 200, 180, 0, 0, ""},
		{EMULATOR_LIBERTY, 3, 200, 0, -1.5, 0,
		 "A2 3 0 0 200 0 0 0 200 0; N2 -1.5 0 0"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		begin(cases[i].kind, -1);
		e.present[1] = true;
		e.alignment[1][0] = cases[i].origin;
		e.alignment[1][3] = cases[i].along_x;
		e.mounting[1][2] = cases[i].roll;
		e.tip[1][0] = cases[i].tip;
		e.boresight[1][1] = cases[i].elevation;
		e.tip[2][0] = 7; /* of a station that is not used */
		if (set_up(&two))
			fail_msg("case %zu: %s", i, err.text);
		if (!strstr(identity.note, cases[i].note) ||
		    !*identity.note != !*cases[i].note)
			fail_msg("case %zu: %s", i, identity.note);
		assert_int_equal(e.boresights, 0);
		assert_string_equal(err.text, "");
	}
}

/* The line of an adapter that wakes up: all that came before is given out at once. */
TEST(stale_bytes_at_the_start, NULL, end)
{
	static const enum emulator_kind kinds[] = {EMULATOR_FASTRAK, EMULATOR_LIBERTY,
						   EMULATOR_PATRIOT};

	for (int k = 0; k < 3; k++)
		for (int late_ms = 0; late_ms < 1000; late_ms += 20) {
			begin(kinds[k], -1);
			line.late_ns = line.now_ns + late_ms * INT64_C(1000000);
			if (set_up(&first))
				fail_msg("kind %d, %d ms: %s", k, late_ms, err.text);
		}
}

TEST(sync_from_outside, NULL, end)
{
	struct incise_tracker_setup s = first;

	for (int sync = 1; sync <= 2; sync++) {
		begin(EMULATOR_FASTRAK, -1);
		s.sync = (enum incise_tracker_sync)sync;
		assert_int_equal(set_up(&s), 0);
		assert_int_equal(e.sync, sync);
		/* Left so by somebody, with no pulses. */
		begin(EMULATOR_FASTRAK, -1);
		e.sync = sync;
		assert_int_equal(set_up(&first), 0);
		assert_int_equal(e.sync, 0);
		begin(EMULATOR_LIBERTY, -1);
		assert_int_equal(set_up(&s), -EINVAL);
		assert_non_null(strstr(err.text, "sync"));
	}
}

/* A setting that the tracker ignores is detected and named, for each command. */
TEST(what_is_not_taken, NULL, end)
{
	static const struct {
		enum emulator_kind kind;
		const char *stuck, *says;
	} cases[] = {
		{EMULATOR_FASTRAK, "u", "centimetres"},
		{EMULATOR_FASTRAK, "O", "items"},
		{EMULATOR_FASTRAK, "H", "hemisphere"},
		{EMULATOR_FASTRAK, "I", "increment"},
		{EMULATOR_FASTRAK, "x", "position"},
		{EMULATOR_FASTRAK, "v", "attitude"},
		{EMULATOR_FASTRAK, "y", "sync"},
		{EMULATOR_FASTRAK, "l", "station"},
		{EMULATOR_LIBERTY, "U", "centimetres"},
		{EMULATOR_LIBERTY, "H", "hemisphere"},
		{EMULATOR_LIBERTY, "X", "position"},
		{EMULATOR_LIBERTY, "Y", "attitude"},
		{EMULATOR_LIBERTY, "R", "240"},
		{EMULATOR_LIBERTY, "O", "record"},
		{EMULATOR_PATRIOT, "\025", "station"},
	};
	struct incise_tracker_setup s = two;

	s.sync = INCISE_TRACKER_INTERNAL;
	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		int rc;

		begin(cases[i].kind, (int)cases[i].kind);
		e.present[1] = true;
		/* As it is not to be. */
		e.sync = 2;
		e.increment[0] = 2;
		e.stuck = cases[i].stuck;
		rc = set_up(&s);
		if (rc != -EIO || !strstr(err.text, cases[i].says) ||
		    strncmp(err.text, "rig.conf:3: tracker: ", 21))
			fail_msg("%s: %d: %s", cases[i].stuck, rc, err.text);
	}
}

TEST(what_cannot_be, NULL, end)
{
	/* No sensor. */
	begin(EMULATOR_FASTRAK, -1);
	assert_int_equal(set_up(&two), -EIO);
	assert_non_null(strstr(err.text, "station 2"));
	/* Nobody: on a serial line it may be the line. */
	for (int serial = 0; serial <= 1; serial++) {
		begin(EMULATOR_FASTRAK, -1);
		emulator_write(&e, "c", 1);
		line.line.ns_per_byte = serial * 86806;
		e.deaf = true;
		assert_int_equal(set_up(&first), -ETIMEDOUT);
		assert_int_equal(strstr(err.text, "baud") != NULL, serial);
		assert_int_equal(strstr(err.text, "null modem") != NULL, serial);
		assert_int_equal(strstr(err.text, "USB cable") != NULL, !serial);
		assert_null(strchr(err.text, '?'));
	}
	/* One that does not stop; its button would. */
	begin(EMULATOR_FASTRAK, -1);
	e.deaf = e.mouse = true;
	assert_int_equal(set_up(&first), -EBUSY);
	/* Gone in the middle. */
	begin(EMULATOR_FASTRAK, -1);
	line.gone = -ENODEV;
	assert_int_equal(set_up(&first), -ENODEV);
	assert_non_null(strstr(err.text, "disconnected"));
}

/*
 * A sensor that is not plugged in is named, whichever others there are: the last active station
 * stays on, also one that is not wanted.
 */
TEST(station_without_a_sensor, NULL, end)
{
	static const struct incise_tracker_setup wanted[] = {
		{.n_stations = 1, .stations = {2}, .hemisphere = {1, 0, 0}},
		{.n_stations = 1, .stations = {4}, .hemisphere = {1, 0, 0}},
		{.n_stations = 2, .stations = {1, 2}, .hemisphere = {1, 0, 0}},
		{.n_stations = 2, .stations = {3, 4}, .hemisphere = {1, 0, 0}},
	};
	static const enum emulator_kind kinds[] = {EMULATOR_FASTRAK, EMULATOR_LIBERTY};
	char name[20];

	for (size_t k = 0; k < 2; k++)
		for (size_t i = 0; i < sizeof(wanted) / sizeof(*wanted); i++) {
			begin(kinds[k], (int)kinds[k]);
			assert_int_equal(set_up(&wanted[i]), -EIO);
			snprintf(name, sizeof(name), "station %d",
				 wanted[i].stations[0] == 1 ? 2 : wanted[i].stations[0]);
			if (!strstr(err.text, name) || !strstr(err.text, "sensor"))
				fail_msg("%zu %zu: %s", k, i, err.text);
		}
}

TEST(who_is_there, NULL, end)
{
	begin(EMULATOR_FASTRAK, -1);
	assert_int_equal(polhemus_identify(&line.line, &identity, "tty", &err), 0);
	assert_string_equal(identity.version, "3.02");
	begin(EMULATOR_PATRIOT, -1);
	assert_int_equal(polhemus_identify(&line.line, &identity, "tty", &err), 0);
	assert_int_equal(identity.layout.family, POLHEMUS_PATRIOT);
}

/* A byte at a time: at 9600 baud there is time enough; what trickles is given up. */
TEST(slow_line, NULL, end)
{
	static const struct {
		enum emulator_kind kind;
		int64_t byte_ns;
		char slow_from;
		const char *says; /* NULL: it is set up */
	} cases[] = {
		{EMULATOR_FASTRAK, 1041667, 0, NULL},
		{EMULATOR_LIBERTY, 1041667, 0, NULL},
		/* a tracker that does not stop sending is reported before */
		{EMULATOR_FASTRAK, 40000000, 0, "stop"},
		{EMULATOR_FASTRAK, 80000000, 'O', "15 s"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		int rc;

		begin(cases[i].kind, -1);
		e.present[1] = true;
		line.most = 1;
		line.slow_from = cases[i].slow_from;
		line.read_ns = cases[i].byte_ns;
		rc = set_up(&two);
		if (cases[i].says ? !rc || !strstr(err.text, cases[i].says) : rc)
			fail_msg("case %zu: %d %s", i, rc, err.text);
		/* the limit, and what is waited for before the first byte */
		assert_true(line.now_ns < INT64_C(20000000000));
	}
}
