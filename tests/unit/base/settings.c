// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/base/settings.c: for each kind of setting what is taken and what is refused, with place, key and
 * value; that what is printed reads back the same; and conf.c: files that are none.
 */
#include "../unit.h"
#include "../../../lib/base/random.h"
#include "../../../lib/base/settings.h"
#include "temp_file.h"

struct content {
	double number, scaled, vector[3], direction[3], pair[2], most[4];
	int whole, word, n_most;
	uint8_t u8;
	uint32_t us;
	uint64_t u64;
	bool truth;
	char text[8];
	const char *pointer;
};

static bool is_even(const double *number, int n, const char *text)
{
	(void)n;
	(void)text;
	return (int)*number % 2 == 0;
}

static int read_own(void *to, const config_setting_t *setting, const char *path,
		    struct incise_error *err)
{
	(void)to;
	return config_setting_length(setting) == 2
		       ? 0
		       : incise_conf_error(setting, NULL, path, err, "a pair");
}

#define SETTINGS_OF struct content
static const char *const words[] = {"one", "two", NULL};
static const struct incise_setting inner[] = {
	SETTING_WHOLE(even, whole, "", 0, 10, "4", "an even number", .fits = is_even,
		      .expected = "an even number"),
	SETTING_NUMBER(needed_mm, u8, "mm", 1, 9, SETTING_REQUIRED, "needed"),
	{0},
};
static const struct incise_setting rows[] = {
	SETTING_NUMBER(number, number, "N", -1, 100, "7.5", "a number"),
	SETTING_NUMBER(reach_ms, scaled, "ms", 0, 1000, "50", "a time", .scale = 1e-3),
	SETTING_NUMBER(tick_us, us, "us", 0.5, 1000, "(none)", "a time", .scale = 1000),
	SETTING_WHOLE(big, u64, "", 0, 2147483647, "1", "a whole number"),
	SETTING_VECTOR(point_mm, vector, "mm", "[1, 2, -3]", "a point"),
	SETTING_DIRECTION(normal, direction, "[0, 0, 1]", "a direction"),
	SETTING_NUMBER(pair, pair, "", 0, 9, "[1, 2.5]", "two"),
	SETTING_NUMBER(most, most, "", 0, 9, "[5]", "up to four",
		       .count = offsetof(struct content, n_most)),
	SETTING_TRUTH(truth, truth, "true", "true or false"),
	SETTING_WORD(word, word, words, "two", "a word"),
	SETTING_TEXT(text, text, "abc", "short text"),
	SETTING_TEXT(pointer, pointer, "(none)", "any text"),
	SETTING_GROUP(inner, inner, "a group"),
	SETTING_OWN(own, "", "(none)", "two of something", .read = read_own),
	{0},
};

static int read_text(const char *text, struct content *content, struct incise_error *err)
{
	config_t config;
	char *copy = strdup(text);
	int rc = incise_conf_read_text(&config, "a.conf", copy, strlen(copy), err);

	free(copy);
	if (rc)
		return rc;
	rc = incise_settings_read(rows, config_root_setting(&config), "a.conf", content,
				  err);
	config_destroy(&config);
	return rc;
}

TEST(refused_with_file_line_key_and_value)
{
	static const struct {
		const char *text, *says[2]; /* the place and key, and the value */
	} row[] = {
		{"\nnumber = 101;", {"a.conf:2: number:", "101"}},
		{"\n\nnumber = -1.5;", {"a.conf:3: number:", "-1.5"}},
		{"number = 1e999;", {":1: number:", "inf"}},
		{"number = \"1\";", {":1: number:", "\"1\""}},
		{"number = true;", {":1: number:", "true"}},
		{"number = [1];", {":1: number:", "[1]"}},
		{"number = {};", {":1: number:", "a group"}},
		{"reach_ms = 1001;", {":1: reach_ms:", "1001"}},
		{"tick_us = 0.4;", {":1: tick_us:", "0.4"}},
		{"big = 2.5;", {":1: big:", "2.5"}},
		{"big = -1;", {":1: big:", "-1"}},
		{"big = 2147483648;", {":1: big:", "2147483648"}},
		{"point_mm = [1, 2];", {":1: point_mm:", "[1, 2]"}},
		{"point_mm = [1e7, 0.0, 0.0];", {":1: point_mm:", "[10000000, 0, 0]"}},
		{"point_mm = ( 1, 2, \"3\" );", {":1: point_mm:", "\"3\"]"}},
		{"point_mm = 1;", {":1: point_mm:", "1"}},
		{"normal = [0, 0, 0];", {":1: normal:", "[0, 0, 0]"}},
		{"normal = [0.0, 1e-7, 0.0];", {":1: normal:", "1e-07"}},
		{"pair = [1];", {":1: pair:", "[1]"}},
		{"pair = [1, 2, 3];", {":1: pair:", "[1, 2, 3]"}},
		{"pair = [];", {":1: pair:", "[]"}},
		{"most = [1, 2, 3, 4, 5, 6];", {":1: most:", "[1, 2, 3, 4, … 6 values]"}},
		{"most = [1, 10];", {":1: most:", "[1, 10]"}},
		{"most = 1;", {":1: most:", "1"}},
		{"truth = 1;", {":1: truth:", "1"}},
		{"truth = \"true\";", {":1: truth:", "\"true\""}},
		{"word = \"tow\";", {":1: word:", "\"tow\""}},
		{"word = 1;", {":1: word:", "1"}},
		{"text = \"12345678\";", {":1: text:", "12345678"}},
		{"text = 3;", {":1: text:", "3"}},
		{"pointer = [\"a\"];", {":1: pointer:", "[\"a\"]"}},
		{"inner = {\n even = 3; needed_mm = 1; };", {":2: inner.even:", "3"}},
		{"\ninner = { even = 2; };", {":2: inner.needed_mm:", "missing"}},
		{"inner = 1;", {":1: inner:", "1"}},
		{"inner = { needed_cm = 1; };", {":1: inner.needed_cm:", "needed_mm"}},
		{"own = [1];", {":1: own:", "[1]"}},
		{"numbre = 1;", {":1: numbre:", "did you mean number"}},
		{"reach_s = 1;", {":1: reach_s:", "reach_ms"}},
		{"span = 1;", {":1: span:", "expected one of number, "}},
		{"number = 1;\nnumber = 2;", {":2: duplicate setting"}},
		{"number 1;", {":1: syntax error:"}},
		{"@include \"x\"", {":1: @include"}},
	};

	for (size_t i = 0; i < sizeof(row) / sizeof(row[0]); i++) {
		struct content content = {0};

		assert_error(read_text(row[i].text, &content, &err), EINVAL, &err,
			     row[i].says[0], row[i].says[1]);
	}
}

TEST(defaults_and_what_a_file_gives)
{
	struct content c = {0};

	incise_settings_init(rows, &c);
	assert_true(c.number == 7.5 && c.scaled == 0.05 && c.us == 0 && c.u64 == 1);
	assert_true(c.vector[0] == 1 && c.vector[1] == 2 && c.vector[2] == -3);
	assert_true(c.direction[2] == 1 && c.pair[1] == 2.5 && c.most[0] == 5);
	assert_int_equal(c.n_most, 1);
	assert_true(c.truth && c.word == 1 && !c.pointer && c.whole == 4);
	assert_string_equal(c.text, "abc");
	assert_int_equal(
		read_text("\xef\xbb\xbf# a comment\n"
			  "number = 42; reach_ms = 1.5; tick_us = 0.5;\n"
			  "big = 2147483647; point_mm = (1, 2.5, 3);\n"
			  "normal = [0, 3, 4]; pair = [0.5, 9.0]; most = [1, 2];\n"
			  "truth = false; word = \"one\"; text = \"1234567\";\n"
			  "inner = { even = 10; needed_mm = 9; }; own = [1, 2];\n",
			  &c, NULL),
		0);
	assert_true(c.number == 42 && c.scaled == 0.0015 && c.us == 500);
	assert_true(c.u64 == 2147483647 && c.vector[1] == 2.5);
	/* 3-4-5: exact up to one rounding of the division. */
	assert_true(fabs(c.direction[1] - 0.6) < 1e-15);
	assert_true(c.pair[0] == 0.5 && c.most[1] == 2 && c.n_most == 2);
	assert_true(!c.truth && c.word == 0 && c.whole == 10 && c.u8 == 9);
	assert_string_equal(c.text, "1234567");
}

TEST(a_refused_value_leaves_what_was_there)
{
	struct content c = {.number = 7, .direction = {0, 0, 1}};

	assert_int_equal(read_text("number = 101;", &c, NULL), -EINVAL);
	assert_int_equal(read_text("normal = [0, 0, 0];", &c, NULL), -EINVAL);
	assert_int_equal(read_text("", &c, NULL), 0);
	assert_true(c.number == 7 && c.direction[2] == 1);
}

/* As KEY=VALUE of a shorthand. */
TEST(set_by_text)
{
	static const struct {
		const char *key, *text;
		int code;
	} row[] = {
		{"number", "0.5", 0},	    {"number", "", EINVAL},
		{"number", "0.5x", EINVAL}, {"number", "0x1", EINVAL},
		{"number", "nan", EINVAL},  {"number", "101", EINVAL},
		{"big", "1.5", EINVAL},	    {"big", "3", 0},
		{"word", "one", 0},	    {"word", "on", EINVAL},
		{"word", "", EINVAL},	    {"truth", "false", 0},
		{"truth", "0", EINVAL},	    {"most", "3", 0},
		{"most[1]", "4", 0},	    {"most[3]", "4", 0},
		{"most[4]", "4", ENOENT},   {"most[-1]", "4", ENOENT},
		{"most[1", "4", ENOENT},    {"most[1]x", "4", ENOENT},
		{"most[1]", "10", EINVAL},  {"number[0]", "4", ENOENT},
		{"pair", "3", EINVAL},	    {"", "1", ENOENT},
		{"nubmer", "1", ENOENT},    {"inner", "1", ENOENT},
		{"own", "1", ENOENT},
	};

	for (size_t i = 0; i < sizeof(row) / sizeof(row[0]); i++) {
		struct content c = {0}, before;
		char says[40];

		incise_settings_init(rows, &c);
		before = c;
		snprintf(says, sizeof(says), "sim.%s:", row[i].key);
		if (!row[i].code) {
			assert_int_equal(incise_settings_set(rows, "sim", row[i].key,
							     row[i].text, &c, &err),
					 0);
			continue;
		}
		assert_error(incise_settings_set(rows, "sim", row[i].key, row[i].text, &c,
						 &err),
			     row[i].code, &err, says);
		assert_memory_equal(&c, &before, sizeof(c));
	}
}

TEST(an_index_lengthens_and_a_plain_key_is_the_only_one)
{
	struct content c = {0};

	incise_settings_init(rows, &c);
	assert_int_equal(incise_settings_set(rows, "sim", "most[2]", "4", &c, NULL), 0);
	assert_true(c.n_most == 3 && c.most[2] == 4 && c.most[0] == 5);
	assert_int_equal(incise_settings_set(rows, "sim", "most", "6", &c, NULL), 0);
	assert_true(c.n_most == 1 && c.most[0] == 6);
}

TEST(check_finds_what_no_file_can_set)
{
	struct content c = {.us = 1000, .u8 = 1};

	incise_settings_init(rows, &c);
	assert_int_equal(incise_settings_check(rows, "sim", &c, &err), 0);
	c.n_most = 0;
	assert_error(incise_settings_check(rows, "sim", &c, &err), EINVAL, &err,
		     "sim.most:", "0 numbers");
	c.n_most = 5;
	assert_int_equal(incise_settings_check(rows, "sim", &c, NULL), -EINVAL);
	c.n_most = 1;
	c.word = 7;
	assert_error(incise_settings_check(rows, "sim", &c, &err), EINVAL, &err,
		     "sim.word:");
	c.word = 1;
	c.number = NAN;
	assert_error(incise_settings_check(rows, "sim", &c, &err), EINVAL, &err,
		     "sim.number:", "nan");
}

static double uniform(uint64_t *state)
{
	return (incise_random_symmetric(state) + 1) / 2;
}

struct written {
	char text[2000];
	int given, lines;
};

static int write_key(void *context, const struct incise_key *key)
{
	struct written *written = context;
	size_t used = strlen(written->text);
	bool inside = strchr(key->name, '.');

	written->given += key->given;
	written->lines += key->line;
	if (*key->value)
		snprintf(written->text + used, sizeof(written->text) - used,
			 inside ? "inner = { even = 2; %s = %s; };\n" : "%s = %s;\n",
			 inside ? strchr(key->name, '.') + 1 : key->name, key->value);
	return 0;
}

/* Of random values, what is listed reads back to the same. */
TEST(what_is_printed_reads_back)
{
	uint64_t seed = 42;

	for (int i = 0; i < 500; i++) {
		struct content c = {0}, again = {0};
		struct written written = {0};
		struct incise_settings_list list = {.found = write_key,
						    .context = &written};

		incise_settings_init(rows, &c);
		c.number = uniform(&seed) * 100;
		c.us = 500 + (uint32_t)(uniform(&seed) * 999000);
		c.u64 = (uint64_t)(uniform(&seed) * 2147483647);
		for (int k = 0; k < 3; k++)
			c.vector[k] = (uniform(&seed) - 0.5) * 2e6;
		c.n_most = 1 + i % 4;
		for (int k = 0; k < c.n_most; k++)
			c.most[k] = i % 3 ? uniform(&seed) * 9 : k;
		c.truth = i % 2;
		c.word = i % 2;
		snprintf(c.text, sizeof(c.text), "\"\\%d", i);
		incise_settings_init(rows, &again);
		incise_settings_list(&list, rows, &c, NULL, "");
		assert_int_equal(read_text(written.text, &again, &err), 0);
		assert_true(fabs(again.number - c.number) <= 1e-14 * fabs(c.number));
		assert_int_equal(again.us, c.us);
		assert_int_equal(again.u64, c.u64);
		assert_int_equal(again.n_most, c.n_most);
		for (int k = 0; k < c.n_most; k++)
			assert_true(fabs(again.most[k] - c.most[k]) <= 1e-14 * c.most[k]);
		for (int k = 0; k < 3; k++)
			assert_true(fabs(again.vector[k] - c.vector[k]) <=
				    1e-14 * fabs(c.vector[k]));
		assert_true(again.truth == c.truth && again.word == c.word);
		assert_string_equal(again.text, c.text);
		assert_int_equal(written.given + written.lines, 0);
	}
}

TEST(unreadable_files_are_named)
{
	config_t config;

	assert_error(incise_conf_read(&config, "/nowhere/a.conf", &err), ENOENT, &err,
		     "/nowhere/a.conf:");
	assert_error(incise_conf_read(&config, "/", &err), EISDIR, &err, "/:");
	/* As a disk that fails: nothing is at address 0. */
	assert_error(incise_conf_read(&config, "/proc/self/mem", &err), EIO, &err,
		     "/proc/self/mem:");
}
