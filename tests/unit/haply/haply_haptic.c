// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/haply/haply_haptic.c against tests/haply/emulator.py, a service of its own, in real time: each
 * test waits for what it needs to see. Late answers are of simulated time.
 */
#include <locale.h>
#include <sys/wait.h>
#include <jansson.h>
#include "../unit.h"
#include "../../../lib/base/monotonic.h"
#include "../../../lib/base/vector.h"
#include "../../../lib/device/haply/haply_message.h"
#include "../../../lib/rig/backends.h"

#define MS INT64_C(1000000)
#define LONG_NS (60000 * MS) /* until a test gives up */

extern const struct incise_backend incise_haptic_haply;

static FILE *to, *from;
static pid_t emulator;
static int port;
static struct incise_haptic *haptic;
static struct incise_clock *clock_of_test;
static double force_N[3];

static int start_clock(void **state)
{
	(void)state;
	clock_of_test = incise_clock_new_real();
	return 0;
}

static int end_clock(void **state)
{
	(void)state;
	incise_clock_free(clock_of_test);
	return 0;
}

GROUP(start_clock, end_clock);

static void start_emulator(const char *options)
{
	char command[200];
	int in[2], out[2];

	assert_return_code(pipe(in) | pipe(out), errno);
	emulator = fork();
	if (!emulator) {
		dup2(in[0], 0);
		dup2(out[1], 1);
		close(in[1]);
		snprintf(command, sizeof(command),
			 "exec python3 -B tests/haply/emulator.py %s", options);
		execl("/bin/sh", "sh", "-c", command, NULL);
		_exit(127);
	}
	close(in[0]);
	close(out[1]);
	to = fdopen(in[1], "w");
	from = fdopen(out[0], "r");
	assert_int_equal(fscanf(from, "ready %d", &port), 1);
	assert_int_equal(fgetc(from), '\n');
}

/* Say a command and take its line. */
static const char *say(const char *command)
{
	static char line[70000];

	fprintf(to, "%s\n", command);
	fflush(to);
	assert_non_null(fgets(line, sizeof(line), from));
	return line;
}

static void end_emulator(void)
{
	fclose(to);
	fclose(from);
	waitpid(emulator, NULL, 0);
}

static void *try_open(const char *id, const char *options, struct incise_error *err)
{
	static const struct incise_haptic_setup setup = {.rate_hz = 1000};
	struct incise_backend_request request = {
		.where = "a.conf:1: haptic", .haptic = &setup, .clock = clock_of_test};
	char arguments[100];

	if (options)
		start_emulator(options);
	snprintf(arguments, sizeof(arguments), "localhost:%d%s", port, id);
	request.arguments = arguments;
	return incise_haptic_haply.open(&request, err);
}

static void open_device(const char *options)
{
	haptic = try_open("", options, &err);
	succeeds(haptic);
	haptic->info.peak_N = 5;
	memset(force_N, 0, sizeof(force_N));
}

static void close_device(void)
{
	haptic->ops->close(haptic);
	end_emulator();
}

/* A step of an owner; whether there is a sample. */
static bool step_for(struct incise_haptic_sample *sample, int64_t most_ns)
{
	int rc;

	haptic->ops->wait(haptic, most_ns);
	rc = incise_haptic_read(haptic, sample, 1);
	incise_haptic_push(haptic, force_N, NULL);
	assert_true(rc == 0 || rc == 1);
	return rc;
}

static bool step(struct incise_haptic_sample *sample)
{
	return step_for(sample, 50 * MS);
}

/* Until a sample has these of the flags. */
static struct incise_haptic_sample wait_flags(uint32_t flags)
{
	int64_t until_ns = incise_clock_now(clock_of_test) + LONG_NS;
	struct incise_haptic_sample sample = {0};

	do {
		assert_true(incise_clock_now(clock_of_test) < until_ns);
		/* A time of this test. */
		assert_true(!step(&sample) || sample.t_ns > until_ns - 2 * LONG_NS);
	} while (sample.flags != flags || !sample.t_ns);
	return sample;
}

/* Until the emulator got a force that is at most so far off. */
static void wait_force(const double expected_N[3], double tolerance)
{
	int64_t until_ns = incise_monotonic_ns() + LONG_NS;
	struct incise_haptic_sample sample;
	double off = 1;
	json_t *report;

	while (off > tolerance) {
		assert_true(incise_monotonic_ns() < until_ns);
		step(&sample);
		report = json_loads(say("report"), JSON_DECODE_INT_AS_REAL, NULL);
		off = 0;
		for (size_t i = 0; i < 3; i++)
			off = fmax(off,
				   fabs(json_real_value(json_array_get(
						json_object_get(report, "force"), i)) -
					expected_N[i]));
		assert_int_equal(json_array_size(json_object_get(report, "complaints")),
				 0);
		json_decref(report);
	}
}

static bool has_cause(const char *part, char text[400])
{
	incise_haptic_cause(haptic, text, 400);
	return strstr(text, part);
}

/* The same with a reason: on a busy machine answers are late, too. */
static struct incise_haptic_sample wait_cause(uint32_t flags, const char *part)
{
	int64_t until_ns = incise_monotonic_ns() + LONG_NS;
	struct incise_haptic_sample sample;
	char text[400];

	do {
		if (incise_monotonic_ns() > until_ns)
			fail_msg("no cause \"%s\", but \"%s\"", part, text);
		sample = wait_flags(flags);
	} while (!has_cause(part, text));
	message_record(text);
	return sample;
}

TEST(each_format_gives_poses_and_takes_forces)
{
	static const struct {
		const char *options;
		bool grip;
	} cases[] = {{"--format 3.0 --grip wired", true},
		     {"--format 3.1 --grip wireless", true},
		     {"--format 3.5 --grip wireless", true},
		     {"--format 3.5 --grip none", false}};
	const double turned[4] = {sqrt(1 - 0.14), 0.1, 0.2, -0.3}, straight[4] = {1};
	struct incise_haptic_sample sample;
	int64_t until_ns;

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		open_device(cases[i].options);
		assert_int_equal(!!(haptic->info.features &
				    INCISE_HAPTIC_PAGE_ORIENTATION),
				 cases[i].grip);
		assert_true(haptic->info.features & INCISE_HAPTIC_PAGE_GRAVITY);
		assert_non_null(strstr(haptic->info.name, "049D"));
		assert_non_null(strstr(haptic->info.filters, "scaling_factor:1.0"));
		sample = wait_flags(0);
		assert_true(sample.position_mm[1] == 1e3 * -0.12);
		assert_true(sample.velocity_mm_s[2] == 0);
		assert_memory_equal(sample.quaternion, cases[i].grip ? turned : straight,
				    sizeof(turned));
		force_N[0] = 1.0 / 3;
		force_N[1] = -1e-17;
		wait_force(force_N, 0);
		assert_non_null(strstr(say("report"), strstr(cases[i].options, "3.5")
							      ? "\"profile\": \"incise\""
							      : "\"profile\": null"));
		haptic->ops->close(haptic);
		until_ns = incise_monotonic_ns() + LONG_NS;
		while (!strstr(say("report"), "\"force\": [0.0, 0.0, 0.0]"))
			assert_true(incise_monotonic_ns() < until_ns);
		end_emulator();
	}
}

TEST(all_digits_are_right_in_a_locale_with_a_comma)
{
	struct incise_haptic_sample sample;
	bool comma = setlocale(LC_ALL, "de_DE.UTF-8");

	if (!comma)
		print_message("no locale de_DE.UTF-8\n");
	open_device("");
	assert_non_null(strstr(haptic->info.filters, "force_gate:gain:0.3,damping"));
	say("raw 1000000 {\"inverse3\": [{\"device_id\": \"049D\", \"state\": "
	    "{\"cursor_position\": {\"x\": 0.12345678901234567, \"y\": -1.7e-300, "
	    "\"z\": 9.9999999999999982}}}], \"verse_grip\": [{\"device_id\": \"8200\", "
	    "\"state\": {\"orientation\": {\"x\": 0, \"y\": 0, \"z\": 0, \"w\": 1}, "
	    "\"button\": true, \"hall\": 1}}]}");
	do
		sample = wait_flags(0);
	while (!sample.buttons);
	assert_true(sample.position_mm[0] == 1e3 * 0.12345678901234567);
	assert_true(sample.position_mm[1] == 1e3 * -1.7e-300);
	assert_true(sample.position_mm[2] == 1e3 * 9.9999999999999982);
	assert_true(isnan(sample.velocity_mm_s[0]));
	assert_int_equal(sample.buttons, 1 | 8);
	force_N[2] = 0.12345678901234568;
	wait_force(force_N, 0);
	close_device();
	setlocale(LC_ALL, "C");
}

TEST(no_force_above_the_peak_or_without_a_known_one)
{
	static const double limited_N[3] = {3, 4, 0}, none_N[3];

	open_device("");
	wait_flags(0);
	force_N[0] = 30;
	force_N[1] = 40;
	wait_force(limited_N, 1e-11);
	haptic->info.peak_N = 0;
	wait_force(none_N, 0);
	close_device();
}

TEST(another_id_ends_the_force_until_it_is_opened_again)
{
	static const double none_N[3];

	open_device("");
	wait_flags(0);
	force_N[0] = 1;
	wait_force(force_N, 0);
	say("id 04B2");
	wait_cause(INCISE_HAPTIC_NOT_READY | INCISE_HAPTIC_CHANGED, "049D was unplugged");
	say("id 049D");
	wait_flags(INCISE_HAPTIC_CHANGED);
	/* Its messages name the old id: each was a complaint. */
	say("report");
	wait_force(none_N, 0);
	haptic->ops->close(haptic);
	open_device(NULL);
	wait_flags(0);
	close_device();
}

TEST(what_is_no_good_frame_is_not_ready)
{
	static const struct {
		const char *answer, *cause;
	} cases[] = {
		{"{\"inverse3\": [{\"device_id\": \"049D\", \"state\": "
		 "{\"cursor_position\": {\"x\": NaN, \"y\": 0, \"z\": 0}}}]}",
		 "not understood"},
		{"{\"inverse3\": [{\"device_id\": \"049D\", \"state\": "
		 "{\"cursor_position\": {\"x\": null, \"y\": 0, \"z\": 0}}}]}",
		 "no position"},
		{"{\"inverse3\": [{\"device_id\": \"049D\", \"state\": "
		 "{\"cursor_position\": {\"x\": 1e300, \"y\": 0, \"z\": 0}}}]}",
		 "no position"},
		{"{\"inverse3\": [{\"device_id\": \"049D\", \"state\": null}]}",
		 "no position"},
		{"{\"inverse3\": [{\"device_id\": \"049D\"}]}", "no position"},
		{"{\"inverse3\": []}", "not there"},
		{"{\"inverse3\": null}", "not there"},
		{"{}", "not there"},
		{"[]", "not understood"},
		{"x", "not understood"},
	};
	struct incise_haptic_sample sample;
	char command[300];

	open_device("");
	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		wait_flags(0);
		snprintf(command, sizeof(command), "raw 9 %s", cases[i].answer);
		say(command);
		sample = wait_cause(INCISE_HAPTIC_NOT_READY, cases[i].cause);
		assert_true(sample.position_mm[1] == 1e3 * -0.12);
	}
	assert_true(incise_haptic_lost(haptic) >= 1);
	close_device();
}

TEST(a_frame_that_is_too_long_is_not_understood)
{
	static char command[70000] = "raw 3 {\"inverse3\": [\"";

	open_device("");
	memset(command + strlen(command), 'x', sizeof(command) - 100);
	strcat(command, "\"]}");
	say(command);
	do
		wait_flags(INCISE_HAPTIC_NOT_READY);
	while (!incise_haptic_lost(haptic));
	wait_flags(0);
	close_device();
}

TEST(states_of_the_device_are_flags_with_a_reason)
{
	static const struct {
		const char *begin, *end, *cause;
		uint32_t flags;
	} cases[] = {
		{"say inverse3.status.calibrated false",
		 "say inverse3.status.calibrated true", "not calibrated",
		 INCISE_HAPTIC_NOT_READY},
		{"say inverse3.status.power_supply null",
		 "say inverse3.status.power_supply true", "power supply",
		 INCISE_HAPTIC_NOT_READY},
		{"say verse_grip.status.ready false", "say verse_grip.status.ready true",
		 "VerseGrip", INCISE_HAPTIC_NOT_READY},
		{"say verse_grip.state.orientation.w 0.5",
		 "say verse_grip.state.orientation.w 0.92736184954957", "orientation",
		 INCISE_HAPTIC_NOT_READY},
		{"say inverse3.state.transform {\"scale\": {\"x\": 2, \"y\": 2, \"z\": 2}}",
		 "drop inverse3.state.transform", "scaled", INCISE_HAPTIC_NOT_READY},
		{"event {\"name\": \"device-safety-triggered\", \"level\": \"error\", "
		 "\"data\": {\"device_id\": \"049D\", \"safety_type\": "
		 "\"ebrake_triggered\"}, \"message\": \"brake \\u0007 on\"}",
		 "event {\"name\": \"device-safety-triggered\", \"level\": \"notice\", "
		 "\"data\": {\"device_id\": \"049D\", \"safety_type\": "
		 "\"ebrake_released\"}}",
		 "triggered: brake ? on", INCISE_HAPTIC_PROTECTED},
		{"event {\"name\": \"device-safety-triggered\", \"level\": \"warning\", "
		 "\"data\": {\"safety_type\": \"fod_stage_changed\"}}",
		 "event {\"name\": \"device-safety-triggered\", \"level\": \"info\", "
		 "\"data\": {\"safety_type\": \"fod_stage_changed\"}}",
		 "manual", INCISE_HAPTIC_PROTECTED},
		/* Ends by itself. */
		{"event {\"name\": \"device-safety-triggered\", \"level\": \"warning\", "
		 "\"data\": {\"safety_type\": \"stall_detected\"}}",
		 "event {\"name\": \"device-battery-low\", \"data\": {\"device_id\": "
		 "\"another\"}}",
		 "manual", INCISE_HAPTIC_PROTECTED},
		{"event {\"name\": \"device-battery-low\", \"data\": {\"device_id\": "
		 "\"8200\"}}",
		 NULL, "battery-low", INCISE_HAPTIC_BATTERY},
		{"event {\"name\": \"device-disconnected\", \"data\": {\"device_id\": "
		 "\"049D\"}}",
		 NULL, "unplugged", INCISE_HAPTIC_BATTERY | INCISE_HAPTIC_CHANGED},
	};
	static const double none_N[3];

	open_device("");
	assert_string_equal(haptic->info.note, "");
	force_N[0] = 1;
	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		wait_force(force_N, 0);
		say(cases[i].begin);
		wait_cause(cases[i].flags, cases[i].cause);
		if (cases[i].flags != INCISE_HAPTIC_BATTERY &&
		    !strstr(cases[i].begin, "stall"))
			wait_force(none_N, 0);
		if (cases[i].end)
			say(cases[i].end);
		if (cases[i].end)
			wait_flags(0);
	}
	close_device();
}

/* In simulated time a wait for an answer takes none, and the emulator answers when it is told to. */
static struct incise_haptic_sample answer_late(int64_t late_ns)
{
	struct incise_haptic_sample sample;

	say("hold");
	incise_clock_wait_until(clock_of_test, incise_clock_now(clock_of_test) + MS);
	haptic->ops->wait(haptic, 0);
	incise_clock_wait_until(clock_of_test, incise_clock_now(clock_of_test) + late_ns);
	assert_false(step_for(&sample, 0));
	say("release");
	while (!step(&sample))
		;
	return sample;
}

/* The force, along x, of the message that follows, and @n more in time. */
static double follow_force(int n)
{
	struct incise_haptic_sample sample;
	json_t *report;
	double got_N;

	for (; n >= 0; n--)
		while (!step(&sample))
			;
	report = json_loads(say("report"), JSON_DECODE_INT_AS_REAL, NULL);
	got_N = json_real_value(json_array_get(json_object_get(report, "force"), 0));
	json_decref(report);
	return got_N;
}

TEST(a_late_answer_fades_the_force_behind_two_missed_ticks)
{
	static const struct {
		int64_t late_ns;
		double force_N;
	} cases[] = {{2 * MS, 1},
		     {3 * MS, 1},
		     {3250 * MS / 1000, 0.75},
		     {3500 * MS / 1000, 0.5},
		     {4 * MS, 0},
		     {99 * MS, 0}};
	struct incise_clock *real = clock_of_test;
	int64_t sent_ns;

	clock_of_test = incise_clock_new_simulated(1000000 * MS);
	open_device("");
	force_N[0] = 1;
	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		/* In the latency of 1 ms, and two ticks, and a ramp of 100 ms. */
		assert_true(follow_force(103) == 1);
		sent_ns = incise_clock_now(clock_of_test) + MS;
		assert_int_equal(answer_late(cases[i].late_ns).t_ns, sent_ns);
		assert_float_equal(follow_force(0), cases[i].force_N, 1e-12);
		assert_float_equal(follow_force(10), fmin(1, cases[i].force_N + 0.1),
				   1e-12);
	}
	/* The device has gone idle. */
	say("hold");
	incise_clock_wait_until(clock_of_test, incise_clock_now(clock_of_test) + MS);
	haptic->ops->wait(haptic, 0);
	incise_clock_wait_until(clock_of_test,
				incise_clock_now(clock_of_test) + 101 * MS);
	wait_cause(INCISE_HAPTIC_NOT_READY, "late");
	say("release");
	wait_flags(0);
	assert_float_equal(follow_force(0), 0, 1e-12);
	close_device();
	incise_clock_free(clock_of_test);
	clock_of_test = real;
}

TEST(a_force_that_nobody_pushes_again_ends)
{
	int64_t until_ns = incise_monotonic_ns() + LONG_NS;
	struct incise_haptic_sample sample;

	open_device("");
	wait_flags(0);
	force_N[0] = 1;
	wait_force(force_N, 0);
	while (!strstr(say("report"), "\"force\": [0.0, 0.0, 0.0]")) {
		assert_true(incise_monotonic_ns() < until_ns);
		haptic->ops->wait(haptic, 50 * MS);
		incise_haptic_read(haptic, &sample, 1);
	}
	close_device();
}

TEST(a_grip_that_comes_later_is_not_used)
{
	static const double straight[4] = {1};
	struct incise_haptic_sample sample;

	open_device("--grip none");
	say("say verse_grip {\"state\": {\"orientation\": {\"x\": 1, \"y\": 0, \"z\": 0, "
	    "\"w\": 0}, \"button\": true, \"hall\": 1}}");
	say("say inverse3.state.cursor_position.x 0.5");
	do
		sample = wait_flags(0);
	while (sample.position_mm[0] != 1e3 * 0.5);
	assert_memory_equal(sample.quaternion, straight, sizeof(straight));
	assert_int_equal(sample.buttons, 0);
	close_device();
}

TEST(what_ends_the_force_until_it_is_opened_again)
{
	static const struct {
		const char *begin, *end, *cause;
	} cases[] = {
		{"say inverse3.config.filters.force_gate.gain 0.9",
		 "say inverse3.config.filters.force_gate.gain 0.3",
		 "its filters changed (now force_gate:gain:0.9"},
		{"deaf", "report", "the port of its events closed"},
	};
	static const double none_N[3];

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		open_device("");
		wait_flags(0);
		force_N[0] = 1;
		wait_force(force_N, 0);
		say(cases[i].begin);
		wait_cause(INCISE_HAPTIC_PROTECTED, cases[i].cause);
		wait_force(none_N, 0);
		say(cases[i].end);
		wait_cause(INCISE_HAPTIC_PROTECTED, cases[i].cause);
		close_device();
	}
}

TEST(each_member_of_an_event_is_read_on_its_own)
{
	static const struct {
		const char *members, *data;
		int state;
	} cases[] = {
		{"\"level\": null", "\"safety_type\": \"ebrake_triggered\"", HAPLY_BRAKE},
		{"\"message\": 1",
		 "\"device_id\": 1181, \"safety_type\": \"ebrake_triggered\"",
		 HAPLY_BRAKE},
		{"\"message\": []",
		 "\"device_id\": {}, \"safety_type\": \"fod_stage_changed\"",
		 HAPLY_FOREIGN_OBJECT},
		{"\"level\": \"notice\"",
		 "\"device_id\": null, \"safety_type\": \"ebrake_released\"",
		 -HAPLY_BRAKE},
		{"\"level\": \"error\"", "\"safety_type\": \"stall_detected\"",
		 HAPLY_BRIEF},
		{"\"level\": \"error\"", "\"safety_type\": 3", HAPLY_BRAKE},
		{"\"level\": \"info\"", "\"safety_type\": null", HAPLY_BRAKE},
		{"\"level\": \"info\"", "", HAPLY_BRAKE},
		{"\"level\": 1", "\"device_id\": \"other\", \"safety_type\": 1", 0},
	};
	char text[300], words[160];

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		snprintf(text, sizeof(text),
			 "{\"name\": \"device-safety-triggered\", %s, \"data\": {%s}}",
			 cases[i].members, cases[i].data);
		assert_int_equal(haply_event_parse(text, strlen(text), "049D", "8200",
						   words, sizeof(words)),
				 cases[i].state);
	}
}

TEST(a_service_that_ends_is_gone_until_it_is_opened_again)
{
	int64_t until_ns = incise_monotonic_ns() + LONG_NS;
	struct incise_haptic_sample sample;
	char text[400];
	int rc;

	open_device("--no-events");
	assert_non_null(strstr(haptic->info.note, "no events"));
	wait_flags(0);
	say("close");
	do {
		assert_true(incise_monotonic_ns() < until_ns);
		haptic->ops->wait(haptic, 50 * MS);
		rc = incise_haptic_read(haptic, &sample, 1);
	} while (rc >= 0);
	assert_int_equal(rc, -ENODEV);
	/* It would answer again. */
	haptic->ops->wait(haptic, MS);
	assert_int_equal(incise_haptic_read(haptic, &sample, 1), -ENODEV);
	assert_int_equal(incise_haptic_push(haptic, force_N, NULL), -ENODEV);
	assert_true(has_cause("closed the connection", text));
	haptic->ops->close(haptic);
	open_device(NULL);
	wait_flags(0);
	close_device();
}

/* The port is another one each time, and not in the messages that are kept. */
static void assert_refused(const char *id, int code, const char *part)
{
	char digits[10], text[500] = "", *at = err.text, *found;

	assert_null(try_open(id, NULL, &err));
	assert_int_equal(errno, code);
	assert_int_equal(err.code, code);
	snprintf(digits, sizeof(digits), "%d", port);
	for (; (found = strstr(at, digits)); at = found + strlen(digits))
		snprintf(text + strlen(text), sizeof(text) - strlen(text), "%.*sPORT",
			 (int)(found - at), at);
	strncat(text, at, sizeof(text) - strlen(text) - 1);
	assert_says(text, "a.conf:1", part);
}

static int keep_found(void *context, const struct incise_scan_device *device)
{
	strcat(context, strrchr(device->device, '/'));
	return !strncmp(device->device, "haply:localhost:", 16) ? 0 : -1;
}

TEST(a_search_finds_each_inverse3)
{
	char list[100] = "", arguments[100];

	start_emulator("--more 04B2");
	snprintf(arguments, sizeof(arguments), "localhost:%d", port);
	assert_int_equal(incise_haptic_haply.scan(arguments, keep_found, list, &err), 0);
	assert_string_equal(list, "/049D/04B2");
	end_emulator();
	assert_int_equal(incise_haptic_haply.scan(arguments, keep_found, list, &err), 0);
	assert_string_equal(list, "/049D/04B2");
	assert_int_equal(err.code, ENODEV);
	err.code = 0;
	assert_int_equal(incise_haptic_haply.scan("", keep_found, list, &err), 0);
	assert_int_equal(err.code, 0);
}

TEST(what_cannot_be_opened_is_refused)
{
	static const struct {
		const char *id, *options, *part;
		int code;
	} cases[] = {
		{"", "--more 04B2", "049D, 04B2", EINVAL},
		{"/1", "--more 04B2", "049D, 04B2", ENODEV},
		{"/", "", "expected haply:", EINVAL},
		{"0123456789", "", "expected haply:", EINVAL},
		{"/049D0000000000000000000000000000000000", "",
		 "expected haply:", EINVAL},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		start_emulator(cases[i].options);
		assert_refused(cases[i].id, cases[i].code, cases[i].part);
		end_emulator();
	}
	assert_refused("", ENODEV, "no Inverse Service");
}

/* Reported, not judged: HAPLY_SECONDS=60 on an idle machine. In time: the answer comes within the period. */
TEST(ticks_in_time_are_counted)
{
	const char *seconds = getenv("HAPLY_SECONDS");
	int64_t until_ns, now_ns;
	struct incise_haptic_sample sample;
	long ticks = 0, in_time = 0;
	double most_ms = 0;

	open_device("--move");
	until_ns =
		incise_monotonic_ns() + (int64_t)(1e9 * (seconds ? atof(seconds) : 0.1));
	while ((now_ns = incise_monotonic_ns()) < until_ns) {
		if (!step(&sample))
			continue;
		now_ns = incise_monotonic_ns();
		ticks++;
		in_time += now_ns - sample.t_ns < MS;
		most_ms = fmax(most_ms, (double)(now_ns - sample.t_ns) * 1e-6);
	}
	print_message("%ld ticks, %.3f %% in time, most %.1f ms\n", ticks,
		      100.0 * (double)in_time / (double)ticks, most_ms);
	assert_true(ticks > 0);
	close_device();
}
