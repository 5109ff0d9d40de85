// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A bar of progress on a terminal: its share, the time left, how often it is drawn; nothing in a
 * pipe. The clock and the terminal are the test's.
 */
#include "../unit.h"
#include <time.h>
#include "../../../tools/cli/cli.h"

static int64_t now_ns;
static bool on_terminal;
static FILE *shown;

int __wrap_clock_gettime(clockid_t clock, struct timespec *t)
{
	*t = (struct timespec){now_ns / 1000000000, now_ns % 1000000000};
	return 0;
}

int __wrap_isatty(int fd)
{
	return on_terminal && fd == STDERR_FILENO;
}

/* The bar drawn at that time; "" if none is. */
static const char *draw_bar(struct cli_bar *bar, double t_s, double share)
{
	static char text[200];
	int screen = dup(STDERR_FILENO);
	size_t n;

	rewind(shown);
	assert_int_equal(ftruncate(fileno(shown), 0), 0);
	assert_true(dup2(fileno(shown), STDERR_FILENO) >= 0);
	now_ns = (int64_t)(1e9 * (100 + t_s));
	cli_progress_bar("job", share, bar);
	cli_progress_forget();
	assert_true(dup2(screen, STDERR_FILENO) >= 0);
	close(screen);
	rewind(shown);
	n = fread(text, 1, sizeof(text) - 1, shown);
	text[n] = '\0';
	return text;
}

TEST(test_a_bar_shows_the_time_left)
{
	struct cli_bar bar = {0};

	on_terminal = true;
	assert_string_equal(draw_bar(&bar, 0, 0),
			    "job [                              ] 0 %");
	assert_string_equal(draw_bar(&bar, 10, 0.25),
			    "job [#######                       ] 25 %, 30 s left");
	assert_string_equal(draw_bar(&bar, 20, 0.5),
			    "job [###############               ] 50 %, 20 s left");
	/* The same percentage: once a second. */
	assert_string_equal(draw_bar(&bar, 20.9, 0.501), "");
	assert_non_null(strstr(draw_bar(&bar, 21, 0.501), "50 %, 21 s left"));
	assert_string_equal(draw_bar(&bar, 40, 1),
			    "job [##############################] 100 %");
}

TEST(test_a_bar_that_begins_late_tells_no_time)
{
	struct cli_bar bar = {0};

	on_terminal = true;
	assert_null(strstr(draw_bar(&bar, 0, 0.5), "left"));
}

TEST(test_long_times_are_minutes)
{
	struct cli_bar bar = {0};

	on_terminal = true;
	draw_bar(&bar, 0, 0);
	assert_non_null(strstr(draw_bar(&bar, 1, 0.01), "1 %, 99 s left"));
	assert_non_null(strstr(draw_bar(&bar, 60, 0.02), "2 %, 49 min left"));
}

TEST(test_nothing_is_drawn_in_a_pipe)
{
	struct cli_bar bar = {0};

	on_terminal = false;
	assert_string_equal(draw_bar(&bar, 0, 0), "");
	assert_string_equal(draw_bar(&bar, 5, 0.5), "");
}

static int begin(void **state)
{
	shown = tmpfile();
	return !shown;
}

static int end(void **state)
{
	return fclose(shown);
}

GROUP(begin, end);
