// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A trace in characters; see trace.h.
 */
#include <math.h>
#include "trace.h"

#define HEIGHT_MOST 16 /* characters */

void trace_begin(struct trace *trace, const char *unit, double least)
{
	*trace = (struct trace){.unit = unit, .least = least};
}

static struct trace_column *column_at(struct trace *trace, int64_t number)
{
	return &trace->column[number % TRACE_DOTS];
}

void trace_add(struct trace *trace, double t_s, double value)
{
	int64_t number = t_s > 0 ? (int64_t)fmin(t_s / TRACE_COLUMN_S, 1e15) : 0;
	struct trace_column *column;

	if (trace->n && number < trace->newest)
		trace->n = 0;
	if (!trace->n || number - trace->newest >= TRACE_DOTS) {
		trace->newest = number - 1;
		trace->n = 0;
	}
	for (; trace->newest < number; trace->n += trace->n < TRACE_DOTS)
		*column_at(trace, ++trace->newest) = (struct trace_column){NAN, NAN, NAN};
	if (!isfinite(value))
		return;
	column = column_at(trace, number);
	column->low = fmin(column->low, value);
	column->high = fmax(column->high, value);
	column->last = value;
}

static int dots_of(int width)
{
	int dots = 2 * (width - TRACE_LABEL);

	return dots < 0 ? 0 : dots < TRACE_DOTS ? dots : TRACE_DOTS;
}

double trace_span_s(int width)
{
	return dots_of(width) * TRACE_COLUMN_S;
}

/* --- the axis ------------------------------------------------------------------------------ */

struct axis {
	double low, high;
};

/* 1, 2 or 5 times a power of ten, not below a positive value. */
static double round_up(double value)
{
	double power = pow(10, floor(log10(value)));

	for (int i = 0; i < 3; i++) {
		double step = (const double[]){1, 2, 5}[i] * power;

		if (step >= value * (1 - 1e-9))
			return step;
	}
	return 10 * power;
}

#define DIVISIONS 4
#define IGNORED 0.05 /* of the range: noise beyond a round number moves no end */

/* The axis of the columns that are shown, with 0, between round numbers that seldom change. */
static struct axis axis_of(const struct trace *trace, int dots)
{
	double low = 0, high = 0, range, step;

	for (int i = 0; i < trace->n && i < dots; i++) {
		const struct trace_column *column =
			&trace->column[(trace->newest - i) % TRACE_DOTS];

		low = fmin(low, column->low);
		high = fmax(high, column->high);
	}
	low = fmax(low, -1e9);
	high = fmin(high, 1e9);
	range = fmax(high - low, trace->least);
	step = round_up(range / DIVISIONS);
	low = floor((low + IGNORED * range) / step) * step;
	high = ceil((high - IGNORED * range) / step) * step;
	if (high - low < trace->least)
		high = low + DIVISIONS * step;
	return (struct axis){low, high};
}

/* --- dots ---------------------------------------------------------------------------------- */

struct canvas {
	bool dot[4 * HEIGHT_MOST][TRACE_DOTS]; /* from the top */
};

static int row_of(const struct axis *axis, int rows, double value)
{
	double share = (axis->high - value) / (axis->high - axis->low);

	return (int)lround(fmin(fmax(share, 0), 1) * (rows - 1));
}

/* Newest to the right; a column begins where the one before ended, so that the line is whole. */
static void draw_trace(struct canvas *canvas, const struct trace *trace,
		       const struct axis *axis, int dots, int rows)
{
	double before = NAN;

	for (int x = 0; x < dots; x++) {
		int64_t age = dots - 1 - x;
		const struct trace_column *column;
		int top, bottom;

		if (age >= trace->n)
			continue;
		column = &trace->column[(trace->newest - age) % TRACE_DOTS];
		if (!isnan(column->low)) {
			top = row_of(axis, rows, fmax(column->high, before));
			bottom = row_of(axis, rows, fmin(column->low, before));
			for (int y = top; y <= bottom; y++)
				canvas->dot[y][x] = true;
		}
		before = column->last;
	}
}

/* U+2800 and a bit for each dot, as UTF-8. */
static void put_braille(const struct canvas *canvas, int x, int y, FILE *out)
{
	static const int bits[4][2] = {
		{0x01, 0x08}, {0x02, 0x10}, {0x04, 0x20}, {0x40, 0x80}};
	int code = 0x2800;

	for (int i = 0; i < 4; i++)
		for (int j = 0; j < 2; j++)
			if (canvas->dot[4 * y + i][2 * x + j])
				code |= bits[i][j];
	fputc(0xe0 | code >> 12, out);
	fputc(0x80 | (code >> 6 & 0x3f), out);
	fputc(0x80 | (code & 0x3f), out);
}

static void put_ascii(const struct canvas *canvas, int x, int y, FILE *out)
{
	bool half[2] = {false, false};

	for (int i = 0; i < 4; i++)
		for (int j = 0; j < 2; j++)
			half[i / 2] |= canvas->dot[4 * y + i][2 * x + j];
	fputc(half[0] ? half[1] ? ':' : '\'' : half[1] ? '.' : ' ', out);
}

/* "1.5 N|", right-aligned; "     |" between the ends of the axis. */
static void put_label(double value, const char *unit, bool end, FILE *out)
{
	char text[32] = "";

	if (end)
		snprintf(text, sizeof(text), "%.4g %s", value, unit);
	fprintf(out, "\n%*.*s|", TRACE_LABEL - 1, TRACE_LABEL - 1, text);
}

void trace_put(const struct trace *trace, int width, int height, bool braille, FILE *out)
{
	int dots = dots_of(width), last;
	struct canvas canvas = {0};
	struct axis axis = axis_of(trace, dots);

	if (height < 1)
		return;
	if (height > HEIGHT_MOST)
		height = HEIGHT_MOST;
	draw_trace(&canvas, trace, &axis, dots, 4 * height);
	last = height - 1;
	for (int y = 0; y < height; y++) {
		put_label(y ? axis.low : axis.high, trace->unit, !y || y == last, out);
		for (int x = 0; x < dots / 2; x++)
			braille ? put_braille(&canvas, x, y, out)
				: put_ascii(&canvas, x, y, out);
	}
}
