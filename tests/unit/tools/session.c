// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * tools/session: ticks of a made procedure, whose every figure is known, through the digest, the
 * file and the criteria.
 */
#include "../unit.h"
#include <incise/clock.h>
#include "../../../tools/session/session.h"

#define HZ 1000
/* The file's last digit: values are rounded to 1e-4. */
#define DIGIT 5.0001e-5

static char path[] = "/tmp/incise-session-XXXXXX";

static const char text[] =
	"tissue = { insertion_N_mm = 0.1; cut_from_mm = 0.5; stretch_mm = 2.0; };\n"
	"tool = { handle_width_mm = 10.0; handle_thickness_mm = 3.0; tube_mm = 7.0; };\n"
	"membrane = { point_mm = [10.0, 3.0, -8.0]; radius_mm = 6.0; thickness_mm = 4.0;\n"
	"  puncture_N = 0.5; back_wall_mm = 14.0; };\n"
	"criteria = { cut_length_mm = [20.0, 40.0]; off_target_mm = 2.0; membrane = true;\n"
	"  back_wall = false; incisions_most = 1; };\n";

static struct incise_scene *load(const char *scene)
{
	FILE *out = fopen(path, "w");

	assert_non_null(out);
	fputs(scene, out);
	fclose(out);
	return incise_scene_load(path, NULL, NULL);
}

/* Where the made procedure is: a tick follows the last one by 1 ms. */
static struct hand {
	struct session_digest *digest;
	int64_t t_ns;
	enum incise_tool tool;
	double x_mm, y_mm, depth_mm, force_N;
	double turn_deg; /* about z */
	unsigned int flags;
} hand;

static void tick(void)
{
	double half = hand.turn_deg * M_PI / 360;
	struct incise_tick now = {
		.t_ns = hand.t_ns,
		.tool_mm = {hand.x_mm, hand.y_mm, -hand.depth_mm},
		.quaternion = {cos(half), 0, 0, sin(half)},
		.tool = hand.tool,
		.command_N = {0, 0, hand.force_N},
	};

	if (hand.depth_mm >= 0) {
		now.phase = hand.tool == INCISE_TOOL_BLADE ? INCISE_PHASE_CUTTING
							   : INCISE_PHASE_INSERTION;
		now.flags = INCISE_TICK_CONTACT | hand.flags;
		now.depth_mm = hand.depth_mm;
		now.proxy_mm[0] = hand.x_mm;
		now.proxy_mm[1] = hand.y_mm;
		now.normal[2] = 1;
	}
	session_digest_tick(hand.digest, &now);
	hand.t_ns += INCISE_NS_PER_S / HZ;
}

/* Go somewhere evenly in a whole number of ticks. */
static void go(double x_mm, double y_mm, double depth_mm, int ticks)
{
	double from[3] = {hand.x_mm, hand.y_mm, hand.depth_mm};

	for (int i = 1; i <= ticks; i++) {
		double share = (double)i / ticks;

		hand.x_mm = from[0] + share * (x_mm - from[0]);
		hand.y_mm = from[1] + share * (y_mm - from[1]);
		hand.depth_mm = from[2] + share * (depth_mm - from[2]);
		tick();
	}
}

static void lift(enum incise_tool next)
{
	hand.depth_mm = -5;
	hand.flags = 0;
	for (int i = 0; i < HZ; i++)
		tick();
	hand.tool = next;
}

/* A second in the air, a cut of 30 mm along x, three turns of the handle, a tube 16 mm deep. */
static void procedure(void)
{
	hand.tool = INCISE_TOOL_BLADE;
	lift(INCISE_TOOL_BLADE);
	hand.x_mm = 0;
	hand.depth_mm = 3;
	hand.force_N = 1;
	go(30, 0, 3, HZ);
	lift(INCISE_TOOL_HANDLE);
	hand.x_mm = 10;
	hand.depth_mm = 5;
	hand.force_N = 2.5;
	for (int i = 0; i < 3 * HZ; i++) {
		hand.turn_deg = 50 * sin(2 * M_PI * i / (3.0 * HZ));
		tick();
	}
	hand.turn_deg = 0;
	lift(INCISE_TOOL_TUBE);
	hand.depth_mm = 0;
	hand.force_N = 1.5;
	go(10, 0, 8, HZ);
	hand.flags = INCISE_TICK_MEMBRANE;
	go(10, 0, 12, HZ);
	hand.flags = INCISE_TICK_LUMEN;
	go(10, 0, 16, HZ);
}

static void begin(const char *scene_text)
{
	struct incise_scene *scene = load(scene_text);

	hand = (struct hand){.digest = session_digest_new(scene, NULL), .t_ns = 7};
	/* The scene is not needed any more. */
	incise_scene_free(scene);
	assert_non_null(hand.digest);
}

static int begin_text(void **state)
{
	begin(text);
	return 0;
}

static int end(void **state)
{
	session_digest_free(hand.digest);
	return 0;
}

TEST(test_procedure, begin_text, end)
{
	struct session *s;

	procedure();
	s = session_digest_now(hand.digest);
	assert_true(s->ticks == 10000 && s->lost == 0 && s->unusable == 0);
	assert_float_equal(s->duration_s, 9.999, 1e-9);
	/* The lifted blade is in the air for 1000 ticks, from tick 0 on. */
	assert_float_equal(s->first_s, 1.0, 1e-9);
	assert_float_equal(s->last_s, 9.999, 1e-9);
	assert_int_equal(s->n_phases, 3);
	assert_int_equal(s->phase[1].tool, INCISE_TOOL_HANDLE);
	assert_float_equal(s->phase[1].from_s, 3.0, 1e-9);
	assert_float_equal(s->phase[1].to_s, 5.999, 1e-9);
	assert_true(s->phase[1].force_N == 2.5 && s->phase[1].depth_mm == 5);
	assert_int_equal(s->n_cuts, 1);
	/* The first tick of the cut is a step of 30 mm / 1000 in. */
	assert_float_equal(s->cut[0].length_mm, 30 - 0.03, 1e-9);
	assert_float_equal(s->cut[0].direction_deg, 0, 1e-9);
	assert_true(s->cut[0].depth_mm == 3 && s->cut[0].depth_median_mm == 3);
	assert_float_equal(s->cut[0].off_target_mm, 3, 1e-9);
	/* As wide as the tube, less what is elastic. */
	assert_float_equal(s->enlarging.open_mm, 5, 1e-6);
	assert_true(s->enlarging.turns == 3 && s->enlarging.force_N == 2.5);
	assert_float_equal(s->enlarging.turned_deg, 50, 1e-6);
	assert_float_equal(s->enlarging.time_s, 3, 1e-9);
	assert_true(s->insertion.depth_mm == 16 && s->insertion.seated_mm == 16);
	assert_true(s->target.hit && s->target.punctured);
	assert_int_equal(s->target.tool, INCISE_TOOL_TUBE);
	assert_float_equal(s->target.off_axis_mm, 3, 1e-9);
	assert_true(s->target.missed == 0 && s->back_wall.touched == 0);
	assert_true(s->force.largest_N == 2.5 && s->force.tool == INCISE_TOOL_HANDLE);
	/* The tube goes on by 4 mm/s, and 0.5 mm count as another place. */
	assert_true(s->insertion.placed_s <= s->duration_s &&
		    s->insertion.placed_s > s->duration_s - 0.5 / 4 - 2e-3);
}

/* Two cuts that meet are one incision; a tool beside the membrane; the wall behind. */
TEST(test_mistakes, begin_text, end)
{
	struct session_verdict verdicts[INCISE_CRITERIA];
	struct session *s;

	hand.tool = INCISE_TOOL_BLADE;
	hand.depth_mm = 2;
	go(12, 0, 2, HZ);
	lift(INCISE_TOOL_BLADE);
	hand.x_mm = 12;
	hand.depth_mm = 2;
	hand.turn_deg = 90;
	go(12, 12, 2, HZ);
	lift(INCISE_TOOL_BLADE);
	hand.x_mm = 60;
	hand.depth_mm = 0.6;
	hand.turn_deg = 0;
	go(66, 12, 9, HZ);
	lift(INCISE_TOOL_TUBE);
	hand.x_mm = 10;
	hand.y_mm = 0;
	hand.depth_mm = 0;
	go(10, 0, 8, HZ);
	hand.flags = INCISE_TICK_LUMEN;
	go(10, 0, 22, HZ);
	hand.flags |= INCISE_TICK_BACK_WALL;
	go(10, 0, 23, HZ);
	lift(INCISE_TOOL_TUBE);
	s = session_digest_now(hand.digest);
	session_judge(s, verdicts);
	assert_true(s->target.missed == 1);
	/* At a depth of 8 mm the third cut is at x = 65.3, y = 10.6. */
	assert_true(s->target.missed_mm > 55 && s->target.missed_mm < 56.5);
	assert_true(s->back_wall.touched == 1);
	assert_float_equal(s->back_wall.deepest_mm, 1, 1e-9);
	assert_true(s->insertion.depth_mm == 23 && s->insertion.seated_mm == 0);
	assert_true(verdicts[INCISE_CRITERION_INCISIONS].value == 2);
	assert_false(verdicts[INCISE_CRITERION_INCISIONS].met);
	/* From end to end, less a step of each cut. */
	assert_float_equal(verdicts[INCISE_CRITERION_CUT_LENGTH].value, hypot(12, 12),
			   0.1);
	assert_false(verdicts[INCISE_CRITERION_CUT_LENGTH].met);
	assert_true(verdicts[INCISE_CRITERION_BACK_WALL].judged);
	assert_false(verdicts[INCISE_CRITERION_BACK_WALL].met);
	assert_true(verdicts[INCISE_CRITERION_MEMBRANE].met);
	assert_false(verdicts[INCISE_CRITERION_FORCE].judged);
}

/* A cut across another one: one incision, as long as before. */
TEST(test_cross, begin_text, end)
{
	struct session_verdict verdicts[INCISE_CRITERIA];
	struct session *s;

	hand.tool = INCISE_TOOL_BLADE;
	hand.depth_mm = 3;
	go(30, 0, 3, HZ);
	lift(INCISE_TOOL_BLADE);
	hand.x_mm = 15;
	hand.y_mm = -6;
	hand.depth_mm = 3;
	hand.turn_deg = 90;
	go(15, 6, 3, HZ);
	lift(INCISE_TOOL_HANDLE);
	/* Over the crossing, where the nearest cut is now this one and now that. */
	for (int i = 0; i < 2 * HZ; i++) {
		hand.x_mm = 15 + 0.1 * sin(2 * M_PI * i / 7.0);
		hand.y_mm = 0.1 * cos(2 * M_PI * i / 11.0);
		hand.depth_mm = 5;
		hand.turn_deg = 90 + 40 * sin(2 * M_PI * i / (2.0 * HZ));
		tick();
	}
	s = session_digest_now(hand.digest);
	assert_true(s->enlarging.turns == 3);
	session_judge(s, verdicts);
	assert_true(verdicts[INCISE_CRITERION_INCISIONS].value == 1);
	assert_float_equal(verdicts[INCISE_CRITERION_CUT_LENGTH].value, 30 - 0.03, 1e-9);
	assert_true(verdicts[INCISE_CRITERION_CUT_LENGTH].met);
}

/* Without a membrane its criteria are not judged, met or not. */
TEST(test_no_membrane)
{
	struct session_verdict verdicts[INCISE_CRITERIA];
	begin("tissue = { insertion_N_mm = 0.1; };\n"
	      "criteria = { membrane = true; back_wall = false; "
	      "off_target_mm = 5.0; cut_length_mm = [1.0, 2.0]; };\n");

	session_judge(session_digest_now(hand.digest), verdicts);
	for (int i = 0; i < INCISE_CRITERIA; i++)
		assert_int_equal(verdicts[i].judged, i == INCISE_CRITERION_CUT_LENGTH);
	assert_false(verdicts[INCISE_CRITERION_CUT_LENGTH].met);
	session_digest_free(hand.digest);
}

/* A day in which blade and handle take turns: the lists stay within their bounds and say so. */
TEST(test_bounded, begin_text, end)
{
	struct session *s;
	double force_N = 0;

	for (int i = 0; i < 40000; i++) {
		hand.tool = i % 2 ? INCISE_TOOL_HANDLE : INCISE_TOOL_BLADE;
		hand.depth_mm = 0.1;
		hand.force_N = i == 12345 ? 3 : 1;
		tick();
		hand.t_ns += INCISE_NS_PER_S;
		hand.depth_mm = -1;
		tick();
		hand.t_ns += INCISE_NS_PER_S;
	}
	s = session_digest_now(hand.digest);
	assert_true(s->n_phases <= SESSION_PHASES_MAX);
	assert_true(s->n_phases + s->phases_left_out == 40000);
	assert_true(s->n_trace <= SESSION_TRACE_MAX &&
		    s->n_trace >= SESSION_TRACE_MAX / 2);
	assert_true(s->trace_s > 0.02);
	/* The largest force survives, as does the order. */
	for (int i = 0; i < s->n_trace; i++) {
		force_N = fmax(force_N, s->trace[i].force_N);
		assert_true(!i || s->trace[i].t_s > s->trace[i - 1].t_s);
	}
	assert_true(force_N == 3);
}

/* Contacts of one tool grow together where they are too many. */
TEST(test_joined_phases, begin_text, end)
{
	struct session *s;

	hand.tool = INCISE_TOOL_BLADE;
	for (int i = 0; i < 1000; i++) {
		hand.depth_mm = 0.1;
		tick();
		/* Pauses of 0.1 s, and each tenth of 10 s. */
		hand.depth_mm = -1;
		tick();
		hand.t_ns += INCISE_NS_PER_S / (i % 10 ? 10 : 1) * (i % 10 ? 1 : 10);
	}
	s = session_digest_now(hand.digest);
	assert_true(s->phases_left_out == 0);
	assert_true(s->phases_apart_s > 0.1 && s->phases_apart_s < 10);
	/* A group ends behind each long pause: the first contact, 99 groups, the last nine. */
	assert_int_equal(s->n_phases, 101);
}

TEST(test_unusable, begin_text, end)
{
	struct incise_tick bad = {.t_ns = 7};
	struct session *s;

	procedure();
	session_digest_tick(hand.digest, &bad); /* of the past */
	bad.t_ns = hand.t_ns;
	bad.depth_mm = NAN;
	session_digest_tick(hand.digest, &bad);
	bad.depth_mm = 0;
	bad.tool_mm[1] = INFINITY;
	session_digest_tick(hand.digest, &bad);
	bad.tool_mm[1] = 0;
	bad.t_ns = INT64_MAX;
	session_digest_tick(hand.digest, &bad);
	s = session_digest_now(hand.digest);
	assert_true(s->unusable == 4 && s->ticks == 10004);
	assert_float_equal(s->duration_s, 9.999, 1e-9);
}

static char *written(struct session *session)
{
	json_t *json;
	char *dumped;

	strcpy(session->scene.crc32c, "01234567");
	json = session_json(session);
	dumped = json_dumps(json, JSON_INDENT(1) | JSON_REAL_PRECISION(15));
	json_decref(json);
	assert_non_null(dumped);
	return dumped;
}

/* It is read as it was, and written again to the same bytes. */
TEST(test_file, begin_text, end)
{
	struct session *s, *read;
	char *first, *second;

	procedure();
	s = session_digest_now(hand.digest);
	strcpy(s->code, "P07");
	strcpy(s->scene.path, "a\nb\xff");
	s->lost = 12;
	first = written(s);
	read = session_parse(first, strlen(first), "a.session", &err);
	succeeds(read);
	assert_string_equal(read->code, "P07");
	assert_string_equal(read->scene.path, "a?b?");
	assert_true(read->lost == 12 && isnan(read->start_unix_s));
	assert_int_equal(read->n_trace, s->n_trace);
	for (int i = 0; i < s->n_trace; i++)
		assert_float_equal(read->trace[i].tool_mm[2], s->trace[i].tool_mm[2],
				   DIGIT);
	assert_float_equal(read->insertion.placed_s, s->insertion.placed_s, DIGIT);
	assert_memory_equal(read->criteria, s->criteria, sizeof(s->criteria));
	second = written(read);
	assert_string_equal(first, second);
	free(first);
	free(second);
	free(read);
}

/* A member's value becomes another: refused by a line that names the member. */
TEST(test_damaged, begin_text, end)
{
	static const struct {
		const char *from, *to, *says;
		int code;
	} cases[] = {
		{"\"incise_session\": 1", "\"incise_session\": 2", "form 2", EPROTO},
		{"\"incise_session\": 1", "\"incise\": 1", "incise_session", EINVAL},
		{"\"ticks\": 10000", "\"ticks\": -1", "ticks", EINVAL},
		{"\"ticks\": 10000", "\"ticks\": 1.5", "ticks", EINVAL},
		{"\"ticks\": 10000", "\"ticks\": true", "ticks", EINVAL},
		{"\"code\": \"\"", "\"code\": \"A B\"", "code", EINVAL},
		{"\"code\": \"\"", "\"code\": \"-A\"", "code", EINVAL},
		{"\"01234567\"", "\"=1234567\"", "scene.crc32c", EINVAL},
		{"\"01234567\"", "\"0123456\"", "scene.crc32c", EINVAL},
		{"\"kind\": \"asked\"", "\"kind\": \"lost\"", "end.kind", EINVAL},
		{"\"code\": \"\"", "\"code\": \"ABCDEFGHIJKLMNOPQ\"", "code", EINVAL},
		{"\"code\": \"\"", "\"code\": \"\\u001b\"", "code", EINVAL},
		{"\"program\": \"\"", "\"program\": \"a\\u009b\"", "program", EINVAL},
		{"\"tool\": \"handle\",\n   \"from_s\"",
		 "\"tool\": \"spoon\",\n   \"from_s\"", "phases[1].tool", EINVAL},
		{"\"incision\": 0", "\"incision\": 1", "cuts", EINVAL},
		{"\"incision\": 0", "\"incision\": 1024", "cuts[0].incision", EINVAL},
		{"\"direction_deg\": 0.0", "\"direction_deg\": 91.0", "direction_deg",
		 EINVAL},
		{"\"turns\": 3", "\"turns\": null", "enlarging.turns", EINVAL},
		{"\"rows\"", "\"row\"", "trace.rows", EINVAL},
		{"\"hit\": true", "\"hit\": 1", "target.hit", EINVAL},
		{"\"cut_length_mm\": [\n   20.0", "\"cut_length_mm\": [\n   50.0",
		 "criteria.cut_length_mm", EINVAL},
		{"\"phases\": [", "\"phases\": 1, \"more\": [", "phases", EINVAL},
	};
	char *good, *bad, *at;

	procedure();
	good = written(session_digest_now(hand.digest));
	bad = malloc(2 * strlen(good));
	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		at = strstr(good, cases[i].from);
		if (!at)
			fail_msg("case %zu: no %s", i, cases[i].from);
		sprintf(bad, "%.*s%s%s", (int)(at - good), good, cases[i].to,
			at + strlen(cases[i].from));
		assert_error(session_parse(bad, strlen(bad), "a.session", &err),
			     cases[i].code, &err, "a.session", cases[i].says);
	}
	free(good);
	free(bad);
}

TEST(test_codes)
{
	assert_true(session_is_code("P07") && session_is_code("a-b_c"));
	assert_true(session_is_code("ABCDEFGHIJKLMNOP"));
	assert_false(session_is_code("ABCDEFGHIJKLMNOPQ"));
	assert_false(session_is_code("") || session_is_code("A B"));
	assert_false(session_is_code("\xc3\xa9"));
}

static int make_file(void **state)
{
	int fd = mkstemp(path);

	return fd < 0 || close(fd);
}

static int remove_file(void **state)
{
	return unlink(path);
}

GROUP(make_file, remove_file);
