// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of tools/capture/trace.c: dots are where the values are, extremes stay, the line is whole,
 * nothing is wider or higher than asked.
 */
#include "../unit.h"
#include "../../../tools/capture/trace.h"

#define HEIGHT 4

/* Lines of the trace; free(*text). Returns how many. */
static int put(const struct trace *trace, int width, int height, bool braille,
	       char **text, char *lines[16])
{
	size_t size;
	FILE *out = open_memstream(text, &size);
	int n = 0;

	trace_put(trace, width, height, braille, out);
	fclose(out);
	for (char *line = strtok(*text, "\n"); line && n < 16; line = strtok(NULL, "\n"))
		lines[n++] = line;
	return n;
}

/* Dots of the braille character @x of a line, as bits of U+2800. */
static int dots(const char *line, int x)
{
	const unsigned char *c = (const unsigned char *)line + TRACE_LABEL + 3 * x;

	assert_int_equal(c[0], 0xe2);
	assert_int_equal(c[1] & 0xfc, 0xa0);
	return (c[1] & 3) << 6 | (c[2] & 0x3f);
}

TEST(values_are_where_they_belong)
{
	struct trace trace;
	char *text, *lines[16];

	trace_begin(&trace, "N", 0.1);
	/* four columns of dots: 0, 0, 4 N, 4 N; the axis is 0 to 4 N */
	for (int i = 0; i < 4; i++)
		trace_add(&trace, 0.1 * i + 0.05, i < 2 ? 0 : 4);
	assert_int_equal(put(&trace, TRACE_LABEL + 2, HEIGHT, true, &text, lines),
			 HEIGHT);
	assert_memory_equal(lines[0], "     4 N|", TRACE_LABEL);
	assert_memory_equal(lines[1], "        |", TRACE_LABEL);
	assert_memory_equal(lines[3], "     0 N|", TRACE_LABEL);
	/* below: both dots of the last row; the third column joins 0 to 4 */
	assert_int_equal(dots(lines[3], 0), 0x40 | 0x80);
	assert_int_equal(dots(lines[3], 1), 0x01 | 0x02 | 0x04 | 0x40);
	assert_int_equal(dots(lines[1], 1), 0x01 | 0x02 | 0x04 | 0x40);
	assert_int_equal(dots(lines[0], 1), 0x01 | 0x02 | 0x04 | 0x40 | 0x08);
	assert_int_equal(dots(lines[0], 0), 0);
	free(text);
	/* without braille: two levels of a line */
	put(&trace, TRACE_LABEL + 2, HEIGHT, false, &text, lines);
	assert_string_equal(lines[0] + TRACE_LABEL, " :");
	assert_string_equal(lines[3] + TRACE_LABEL, ".:");
	free(text);
}

TEST(a_short_peak_stays)
{
	struct trace trace;
	char *text, *lines[16];

	trace_begin(&trace, "N", 0.1);
	for (int i = 0; i < 100; i++)
		trace_add(&trace, 0.01 * i, i == 37 ? 8 : 0);
	put(&trace, TRACE_LABEL + 5, HEIGHT, true, &text, lines);
	/* column 3 of 10: the right one of the second character */
	assert_int_equal(dots(lines[0], 1), 0x08 | 0x10 | 0x20 | 0x80);
	assert_int_equal(dots(lines[0], 0), 0);
	assert_int_equal(dots(lines[0], 2), 0);
	free(text);
}

TEST(old_values_go_and_gaps_are_empty)
{
	struct trace trace;
	char *text, *lines[16];

	trace_begin(&trace, "mm", 1);
	trace_add(&trace, 0.05, 100);
	trace_add(&trace, 0.15, NAN);
	trace_add(&trace, 1.05, 1);
	/* of ten columns the oldest is that of 0.15 s: the axis is that of 1 mm */
	put(&trace, TRACE_LABEL + 5, HEIGHT, true, &text, lines);
	assert_memory_equal(lines[0], "    1 mm|", TRACE_LABEL);
	for (int x = 0; x < 4; x++)
		assert_int_equal(dots(lines[0], x), 0);
	assert_int_equal(dots(lines[0], 4), 0x08);
	free(text);
	/* a new recording starts at 0 */
	trace_add(&trace, 0.05, 0.5);
	assert_int_equal(trace.n, 1);
	/* and a pause longer than what is kept leaves nothing */
	trace_add(&trace, 1000, 0.5);
	assert_int_equal(trace.n, 1);
}

/* For any input, lines have the width and the height that was asked for. */
TEST(any_value_fits)
{
	static const double values[] = {0,	  -1e-300,   1e300, -1e300,
					INFINITY, -INFINITY, NAN,   1e-9};
	char *text, *lines[16];
	struct trace trace;

	trace_begin(&trace, "N", 0.1);
	for (int width = 0; width < 120; width += 7)
		for (int height = 0; height < 20; height++) {
			int n;

			for (int i = 0; i < 40; i++)
				trace_add(&trace, 0.03 * i * width,
					  values[(width + height + i) % 8]);
			n = put(&trace, width, height, false, &text, lines);
			assert_int_equal(n, height < 16 ? height : 16);
			for (int i = 0; i < n; i++)
				assert_true((int)strlen(lines[i]) <=
					    (width > TRACE_LABEL ? width : TRACE_LABEL));
			free(text);
		}
	assert_true(trace_span_s(79) == 14);
	assert_true(trace_span_s(3) == 0);
}
