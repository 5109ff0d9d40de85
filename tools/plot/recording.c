// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The figure of a recording: its streams on one time axis. See figure.h.
 *
 *     force     ──╱╲──  ──      cuts are shaded and numbered, lost samples are gaps, also shaded
 *     depth     ──╱╲────        by the tracker, and points by the camera
 *     speed     ──┐┌────
 *     position  ────────        x, y, z from the surface's point
 *     streams   ▬▬▬ ▬▬▬ | ||    where there are samples, frames as ticks, and events
 *
 * Each row is read once and kept only as the least and the largest value of its column of pixels,
 * so that memory does not grow with the recording and no extreme is hidden.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <incise/arrow.h>
#include <incise/clock.h>
#include <incise/recording.h>
#include "../cli/batch.h"
#include "../cli/cli.h"
#include "../cli/plot.h"
#include "../cli/recording.h"
#include "figure.h"

#define BINS 2000 /* columns of pixels of a PNG */

/* Margins and key, in shares of the width. */
#define LEFT 0.09
#define RIGHT 0.88

/* --- a line of a panel -------------------------------------------------------------------- */

/* Time that is drawn, from its start, in columns. */
struct span {
	int64_t start_ns; /* the 0 of the axis */
	double from_s, to_s;
};

static double seconds(const struct span *span, int64_t t_ns)
{
	return (double)(t_ns - span->start_ns) / INCISE_NS_PER_S;
}

/* From 0 to BINS - 1; also of times that are not drawn. */
static int bin_of(const struct span *span, double t_s)
{
	double share = (t_s - span->from_s) / (span->to_s - span->from_s);

	return share > 0 ? (int)fmin(share * BINS, BINS - 1) : 0;
}

static double bin_s(const struct span *span, double bin)
{
	return span->from_s + (span->to_s - span->from_s) * bin / BINS;
}

/* The least and the largest value of each column, in the order in which they were read. */
struct recording_line {
	FILE *out;
	const struct span *span;
	int bin; /* of the values below; -1: empty */
	double low, high, low_s, high_s;
	double last_s; /* of the point that was written last; NAN: a gap is before the next */
	int run;       /* points since the gap */
	double least, largest; /* of all that are drawn */
};

static void line_open(struct recording_line *line, const struct span *span,
		      const char *folder, const char *name)
{
	*line = (struct recording_line){
		.out = plot_data(folder, name),
		.span = span,
		.bin = -1,
		.least = INFINITY,
		.largest = -INFINITY,
	};
}

static void put_point(struct recording_line *line, double t_s, double value)
{
	fprintf(line->out, "%.7g %.6g\n", t_s, value);
	line->run++;
	line->last_s = t_s;
}

static void flush_bin(struct recording_line *line)
{
	bool low_first = line->low_s <= line->high_s;

	if (line->bin < 0)
		return;
	put_point(line, low_first ? line->low_s : line->high_s,
		  low_first ? line->low : line->high);
	if (line->low != line->high)
		put_point(line, low_first ? line->high_s : line->low_s,
			  low_first ? line->high : line->low);
	line->bin = -1;
}

/* No line across a gap. */
static void line_gap(struct recording_line *line)
{
	double value = line->low;

	flush_bin(line);
	/* A line of one point would not be seen. */
	if (line->run == 1)
		put_point(line,
			  line->last_s +
				  0.5 * (bin_s(line->span, 1) - bin_s(line->span, 0)),
			  value);
	if (line->run)
		fputc('\n', line->out);
	line->run = 0;
}

static void line_add(struct recording_line *line, double t_s, double value)
{
	int bin = bin_of(line->span, t_s);

	if (isnan(value)) {
		line_gap(line);
		return;
	}
	if (t_s < line->span->from_s || t_s > line->span->to_s)
		return;
	if (bin != line->bin)
		flush_bin(line);
	if (line->bin < 0) {
		line->bin = bin;
		line->low = line->high = value;
		line->low_s = line->high_s = t_s;
	} else if (value < line->low) {
		line->low = value;
		line->low_s = t_s;
	} else if (value > line->high) {
		line->high = value;
		line->high_s = t_s;
	}
	line->least = fmin(line->least, value);
	line->largest = fmax(line->largest, value);
}

static void line_close(struct recording_line *line, const char *folder)
{
	line_gap(line);
	/* Data without a point are an error of gnuplot. */
	fprintf(line->out, "\n%.7g NaN\n", line->span->from_s);
	plot_data_end(line->out, folder);
}

/* --- streams --------------------------------------------------------------------------- */

/* Columns of pixels in which a stream has samples, and in which some were lost. */
struct presence {
	bool sample[BINS], lost[BINS];
	uint64_t rows;
};

enum { FORCE, TRACKER, CAMERA, STREAMS };

static const struct stream {
	const char *name, *arrow;
} streams[STREAMS] = {{"force", "force"}, {"tracker", "tracker"}, {"camera", "frames"}};

#define EVENTS_MOST 2000

struct event {
	double t_s;
	char kind[16], text[64];
};

enum { PANEL_FORCE, PANEL_DEPTH, PANEL_SPEED, PANEL_POSITION, PANELS };

struct recording_range {
	double low, high;
};

struct recorded {
	const struct figure *figure;
	struct incise_recording *recording;
	struct incise_recording_info info;
	struct span span;
	double whole_s; /* all that was recorded */
	struct presence presence[STREAMS];
	uint64_t clipped;
	struct recording_cuts cuts;
	int n_events;
	struct event event[EVENTS_MOST];
	struct recording_range range[PANELS];
	uint64_t rows, rows_read; /* for the progress */
	struct cli_bar progress;
};

static struct ArrowArrayStream open_stream(struct recorded *r, const char *name)
{
	struct ArrowArrayStream stream;
	struct incise_error err = {0};

	cli_check(incise_recording_stream(r->recording, name, NULL, &stream, &err), &err);
	return stream;
}

static bool next_batch(struct recorded *r, struct ArrowArrayStream *stream,
		       struct ArrowArray *batch)
{
	if (stream->get_next(stream, batch))
		cli_fail("%s", stream->get_last_error(stream));
	if (cli_stop)
		cli_fail("interrupted; nothing was written");
	if (!batch->release)
		return false;
	r->rows_read += (uint64_t)batch->length;
	if (r->rows)
		cli_progress_bar(r->figure->path,
				 fmin(1, (double)r->rows_read / (double)r->rows),
				 &r->progress);
	return true;
}

/* Note a sample, and losses before it; returns whether there were losses. */
static bool note_sample(struct recorded *r, int stream, int64_t seq, double t_s,
			int64_t *last_seq, double *last_s)
{
	struct presence *presence = &r->presence[stream];
	bool lost = presence->rows && seq != *last_seq + 1;

	if (lost && t_s >= r->span.from_s && *last_s <= r->span.to_s)
		for (int bin = bin_of(&r->span, *last_s); bin <= bin_of(&r->span, t_s);
		     bin++)
			presence->lost[bin] = true;
	if (t_s >= r->span.from_s && t_s <= r->span.to_s)
		presence->sample[bin_of(&r->span, t_s)] = true;
	presence->rows++;
	*last_seq = seq;
	*last_s = t_s;
	return lost;
}

static void widen_recording(struct recording_range *range,
			    const struct recording_line *line)
{
	range->low = fmin(range->low, line->least);
	range->high = fmax(range->high, line->largest);
}

/* The lines of a stream, each of a column, less the coordinate of the surface's point if any. */
struct shown {
	int stream, panel, n, column;
	const char *files[3];
};

static void read_lines(struct recorded *r, struct ArrowArrayStream *stream,
		       const struct shown *shown, const double *zero,
		       struct recording_line *clipped)
{
	const char *folder = r->figure->folder;
	struct ArrowArray batch;
	struct recording_line lines[3];
	int64_t last_seq = 0;
	double last_s = 0;

	for (int k = 0; k < shown->n; k++)
		line_open(&lines[k], &r->span, folder, shown->files[k]);
	for (; stream && last_s <= r->span.to_s && next_batch(r, stream, &batch);
	     batch.release(&batch))
		for (int64_t i = 0; i < batch.length; i++) {
			double t_s = seconds(&r->span, whole_at(&batch, 1, i));
			bool lost = note_sample(r, shown->stream, whole_at(&batch, 0, i),
						t_s, &last_seq, &last_s);

			for (int k = 0; k < shown->n; k++) {
				double value = real_at(&batch, shown->column + k, i);

				if (lost)
					line_gap(&lines[k]);
				line_add(&lines[k], t_s, zero ? value - zero[k] : value);
			}
			if (clipped && flag_at(&batch, 4, i)) {
				line_add(clipped, t_s, real_at(&batch, shown->column, i));
				r->clipped +=
					t_s >= r->span.from_s && t_s <= r->span.to_s;
			}
		}
	if (stream)
		stream->release(stream);
	for (int k = 0; k < shown->n; k++) {
		line_close(&lines[k], folder);
		widen_recording(&r->range[shown->panel], &lines[k]);
	}
}

static void read_force(struct recorded *r)
{
	static const struct shown force = {FORCE, PANEL_FORCE, 1, 3, {"force.dat"}};
	struct ArrowArrayStream stream = open_stream(r, "force");
	struct recording_line clipped;

	line_open(&clipped, &r->span, r->figure->folder, "clipped.dat");
	read_lines(r, &stream, &force, NULL, &clipped);
	line_close(&clipped, r->figure->folder);
}

/* A pose that gives no depth is missing here too. */
static void read_depth(struct recorded *r)
{
	struct ArrowArrayStream stream = open_stream(r, "depth");
	const char *folder = r->figure->folder;
	struct recording_line depth, speed;
	struct ArrowArray batch;
	int64_t seq = -1;

	line_open(&depth, &r->span, folder, "depth.dat");
	line_open(&speed, &r->span, folder, "speed.dat");
	for (; next_batch(r, &stream, &batch); batch.release(&batch))
		for (int64_t i = 0; i < batch.length; i++) {
			double t_s = seconds(&r->span, whole_at(&batch, 1, i));

			if (whole_at(&batch, 0, i) != ++seq) {
				line_gap(&depth);
				line_gap(&speed);
				seq = whole_at(&batch, 0, i);
			}
			line_add(&depth, t_s, real_at(&batch, 2, i));
			line_add(&speed, t_s, real_at(&batch, 3, i));
			recording_cuts_step(&r->cuts, t_s, real_at(&batch, 2, i));
		}
	stream.release(&stream);
	line_close(&depth, folder);
	line_close(&speed, folder);
	widen_recording(&r->range[PANEL_DEPTH], &depth);
	widen_recording(&r->range[PANEL_SPEED], &speed);
}

static void read_tracker(struct recorded *r)
{
	static const struct shown position = {
		TRACKER, PANEL_POSITION, 3, 3, {"x.dat", "y.dat", "z.dat"}};
	struct ArrowArrayStream stream = open_stream(r, "tracker");

	read_lines(r, &stream, &position, r->info.surface_point_mm, NULL);
}

/* Recordings of form 1 have no frames, and no stream of them. */
static void read_frames(struct recorded *r)
{
	static const struct shown depth = {CAMERA, PANEL_DEPTH, 1, 7, {"camera.dat"}};
	struct ArrowArrayStream stream;
	struct incise_error err = {0};
	int rc = incise_recording_stream(r->recording, "frames", NULL, &stream, &err);

	cli_check(rc && rc != -ENOTSUP, &err);
	read_lines(r, rc ? NULL : &stream, &depth, NULL, NULL);
}

static void read_events(struct recorded *r)
{
	struct ArrowArrayStream stream = open_stream(r, "events");
	struct ArrowArray batch;

	for (; next_batch(r, &stream, &batch); batch.release(&batch))
		for (int64_t i = 0; i < batch.length; i++) {
			struct event event = {
				.t_s = seconds(&r->span, whole_at(&batch, 0, i))};

			text_at(&batch, 1, i, event.kind, sizeof(event.kind));
			text_at(&batch, 2, i, event.text, sizeof(event.text));
			if (recording_shows_event(event.kind) &&
			    event.t_s >= r->span.from_s && event.t_s <= r->span.to_s &&
			    r->n_events < EVENTS_MOST)
				r->event[r->n_events++] = event;
		}
	stream.release(&stream);
}

/* --- the time that is drawn -------------------------------------------------------------- */

/* First and last time of a stream, which is read for that; the times of force are known. */
static void find_ends(struct recorded *r, const char *name, int64_t *first, int64_t *last)
{
	struct ArrowArrayStream stream;
	struct incise_error err = {0};
	struct ArrowArray batch;
	int rc = incise_recording_stream(r->recording, name, NULL, &stream, &err);

	if (rc == -ENOTSUP)
		return;
	cli_check(rc, &err);
	for (; next_batch(r, &stream, &batch); batch.release(&batch)) {
		int64_t from_ns = whole_at(&batch, 1, 0),
			to_ns = whole_at(&batch, 1, batch.length - 1);

		*first = from_ns < *first ? from_ns : *first;
		*last = to_ns > *last ? to_ns : *last;
	}
	stream.release(&stream);
}

static void find_span(struct recorded *r)
{
	const struct figure *figure = r->figure;
	int64_t first = INT64_MAX, last = INT64_MIN;
	double end_s;

	if (r->info.force) {
		first = r->info.start_ns;
		last = r->info.end_ns;
	}
	find_ends(r, "tracker", &first, &last);
	find_ends(r, "frames", &first, &last);
	if (first > last)
		cli_fail("%s: holds no sample", figure->path);
	r->span.start_ns = r->info.force ? r->info.start_ns : first;
	end_s = seconds(&r->span, last);
	r->whole_s = (double)(last - first) / INCISE_NS_PER_S;
	r->span.from_s = fmax(figure->from_s, seconds(&r->span, first));
	r->span.to_s = fmin(figure->to_s, end_s);
	if (r->span.from_s > end_s || r->span.to_s < seconds(&r->span, first))
		cli_fail("%s: lasts from %.1f to %.1f s, and --range is beside that",
			 figure->path, seconds(&r->span, first), end_s);
	if (!(r->span.to_s > r->span.from_s))
		r->span.to_s = r->span.from_s + 1e-3;
}

/* --- parts beside the lines ------------------------------------------------------------------ */

/* Rows "from to" of the columns that are set, joined where they touch. Returns how many. */
static int write_bins(const struct recorded *r, const bool set[BINS], const char *name)
{
	FILE *data = plot_data(r->figure->folder, name);
	int n = 0;

	for (int bin = 0; bin < BINS; bin++) {
		int from = bin;

		while (bin < BINS && set[bin])
			bin++;
		if (bin == from)
			continue;
		n++;
		fprintf(data, "%.7g %.7g\n", bin_s(&r->span, from), bin_s(&r->span, bin));
	}
	if (!n)
		fprintf(data, "%.7g NaN\n", r->span.from_s);
	plot_data_end(data, r->figure->folder);
	return n;
}

/* Rows "from to number"; a number of 0 has no place. Returns how many. */
static int write_cuts(const struct recorded *r)
{
	FILE *data = plot_data(r->figure->folder, "cuts.dat");
	double apart_s = (r->span.to_s - r->span.from_s) / 45, last_s = -INFINITY;
	int n = 0;

	for (int i = 0; i < r->cuts.n; i++) {
		double from_s = fmax(r->cuts.cut[i].from_s, r->span.from_s);
		double to_s = fmin(r->cuts.cut[i].to_s, r->span.to_s);
		bool fits = (from_s + to_s) / 2 - last_s >= apart_s;

		if (from_s > to_s)
			continue;
		fprintf(data, "%.7g %.7g %d\n", from_s, to_s, fits ? i + 1 : 0);
		if (fits)
			last_s = (from_s + to_s) / 2;
		n++;
	}
	plot_data_end(data, r->figure->folder);
	return n;
}

/* Rows "time text"; of texts that would meet only the first one is shown. */
static void write_events(const struct recorded *r)
{
	FILE *data = plot_data(r->figure->folder, "events.dat");
	/* Seconds of a letter, 7 pixels. */
	double letter_s = (r->span.to_s - r->span.from_s) /
			  ((RIGHT - LEFT) * FIGURE_WIDTH / 7),
	       free_s = -INFINITY;

	for (int i = 0; i < r->n_events; i++) {
		const struct event *event = &r->event[i];
		const char *text = *event->text ? event->text : event->kind;
		int most = (int)((r->span.to_s - event->t_s) / letter_s) + 14;

		fprintf(data, "%.7g ", event->t_s);
		if (event->t_s >= free_s) {
			plot_put_quoted(data, text, most, '"');
			free_s = event->t_s +
				 fmin((double)strlen(text) + 2, most + 3) * letter_s;
		} else {
			fputs("\"\"", data);
		}
		fputc('\n', data);
	}
	plot_data_end(data, r->figure->folder);
}

/* --- panels ------------------------------------------------------------------------------ */

static const struct panel {
	const char *label;
	int height; /* pixels */
	int lost;   /* stream whose losses are shaded */
	const char *plot;
} panels[PANELS] = {
	[PANEL_FORCE] = {"force / N", 270, FORCE,
			 "'force.dat' with lines lt 1 title 'force'"},
	[PANEL_DEPTH] = {"depth / mm", 210, TRACKER,
			 "'depth.dat' with lines lt 1 title 'tracker'"},
	[PANEL_SPEED] = {"speed / (mm/s)", 160, TRACKER, "'speed.dat' with lines lt 1"},
	[PANEL_POSITION] =
		{"position / mm", 190, TRACKER,
		 "'x.dat' with lines lt 1 title 'x', 'y.dat' with lines lt 2 title 'y', "
		 "'z.dat' with lines lt 3 title 'z'"},
};

#define TITLE_HEIGHT 40
#define STREAMS_HEIGHT 192

static int figure_height(void)
{
	int height = TITLE_HEIGHT + STREAMS_HEIGHT;

	for (int i = 0; i < PANELS; i++)
		height += panels[i].height;
	return height;
}

/* Set where the next panel is, below @top pixels, with its key to the right. */
static void place_recording_plot(FILE *script, int top, int height, int gap)
{
	double whole = figure_height(), upper = 1 - (top + 8) / whole;

	fprintf(script,
		"set tmargin at screen %.5f\nset bmargin at screen %.5f\n"
		"set key at screen %g, screen %.5f left top\n",
		upper, 1 - (top + height - gap) / whole, RIGHT + 0.005, upper);
}

/* A margin above and below, and some height where all values are one. */
static void round_range(struct recording_range *range)
{
	double margin;

	if (!(range->high >= range->low))
		*range = (struct recording_range){0, 0};
	margin = 0.06 * (range->high - range->low);
	if (!(margin > 0))
		margin = fmax(0.06 * fabs(range->high), 0.05);
	range->low -= margin;
	range->high += margin;
}

/* Shading of @name's rows from @low to @high; as lines too, which are seen however narrow. */
static void put_boxes(FILE *script, const struct recorded *r, const char *name,
		      double low, double high, const char *colour, double solid,
		      const char *title)
{
	fprintf(script,
		"'%s' using 1:(%g):1:2:(%g):(%g) with boxxyerror fs solid %g noborder fc rgb %s",
		name, low, low, high, solid, colour);
	if (*title)
		fprintf(script, " title '%s'", title);
	fprintf(script,
		", \\\n  '' using (($1+$2)/2):($2-$1<%g?%g:NaN):(0):(%g) with vectors nohead lw 0.5 "
		"lc rgb %s, \\\n  ",
		bin_s(&r->span, 3) - r->span.from_s, low, high - low, colour);
}

static void put_panel(FILE *script, const struct recorded *r, int i, int top, int cuts,
		      const int lost[STREAMS])
{
	static const char *const names[] = {"force-lost.dat", "tracker-lost.dat",
					    "camera-lost.dat"};
	const struct panel *panel = &panels[i];
	const struct recording_range *range = &r->range[i];
	bool first = i == PANEL_FORCE;
	/* The numbers of the cuts are above the data. */
	double high =
		range->high + (first && cuts ? 0.12 * (range->high - range->low) : 0);

	place_recording_plot(script, top, panel->height, 8);
	fprintf(script, "set ylabel '%s'\nset yrange [%g:%g]\nplot ", panel->label,
		range->low, high);
	if (cuts)
		put_boxes(script, r, "cuts.dat", range->low, high, "sky", 0.25,
			  first ? "cut" : "");
	if (lost[panel->lost])
		put_boxes(script, r, names[panel->lost], range->low, range->high,
			  "vermillion", 0.5, first || i == PANEL_DEPTH ? "lost" : "");
	if (r->n_events)
		fprintf(script,
			"'events.dat' using 1:(%g):(0):(%g) with vectors nohead lc rgb grey dt 3, "
			"\\\n  ",
			range->low, range->high - range->low);
	fputs(panel->plot, script);
	if (i == PANEL_DEPTH && r->presence[CAMERA].rows)
		fputs(", \\\n  'camera.dat' using 1:($2>0?$2:NaN) with points lc rgb vermillion pt 7 ps 0.25 title "
		      "'camera'",
		      script);
	if (first && r->clipped)
		fputs(", \\\n  'clipped.dat' with points lc rgb vermillion pt 2 ps 0.5 title "
		      "'clipped'",
		      script);
	if (first && cuts)
		fprintf(script,
			", \\\n  'cuts.dat' using (($1+$2)/2):($3>0?%g:NaN):3 with labels font "
			"small",
			high - 0.05 * (high - range->low));
	fputc('\n', script);
}

/* A row for each stream that there is: where it has samples, of the camera a tick for a frame. */
static void put_streams(FILE *script, const struct recorded *r, int top,
			const int lost[STREAMS])
{
	static const char *const colours[] = {"blue", "blue", "ink"};
	char tics[200] = "";
	int row = 0;

	place_recording_plot(script, top, STREAMS_HEIGHT, 72);
	for (int i = 0; i <= STREAMS; i++)
		if (i < STREAMS ? r->presence[i].rows > 0 : r->n_events > 0)
			snprintf(tics + strlen(tics), sizeof(tics) - strlen(tics),
				 "%s'%s' %d", *tics ? ", " : "",
				 i < STREAMS ? streams[i].name : "events", -row++);
	fprintf(script,
		"set format x '%%h'\nset xlabel 'time / s'\nset ylabel ''\n"
		"set yrange [%g:0.6]\nset ytics (%s)\nplot ",
		0.4 - row, tics);
	row = 0;
	for (int i = 0; i < STREAMS; i++) {
		char *name = cli_text("%s-present.dat", streams[i].name);
		char *gone = cli_text("%s-lost.dat", streams[i].name);

		if (!r->presence[i].rows)
			continue;
		put_boxes(script, r, name, row - 0.3, row + 0.3, colours[i], 0.7, "");
		if (lost[i])
			put_boxes(script, r, gone, row - 0.4, row + 0.4, "vermillion", 1,
				  "");
		row--;
		free(name), free(gone);
	}
	if (r->n_events)
		fprintf(script,
			"'events.dat' using 1:(%d) with points pt 9 ps 0.7 lc rgb green, \\\n"
			"  '' using 1:(%d):2 with labels left offset 1,0 font small "
			"noenhanced, \\\n  ",
			row, row);
	fputs("NaN\n", script);
}

static void put_title(FILE *script, const struct recorded *r)
{
	const struct incise_recording_info *info = &r->info;
	uint64_t lost = 0;

	for (int i = 0; i < info->n_streams; i++)
		lost += info->streams[i].lost;
	if (!info->n_streams)
		lost = info->force_lost + info->tracker_lost;
	fputs("set multiplot\nset label 1 ", script);
	plot_put_text(script, r->figure->path);
	fputs(".', '.", script);
	plot_put_text(script, info->rig);
	fprintf(script, ".', %.4g s from %s, %llu lost", r->whole_s, info->started,
		(unsigned long long)lost);
	if (r->clipped)
		fprintf(script, ", %llu clipped", (unsigned long long)r->clipped);
	if (isnan(info->zero_mV))
		fputs(", no force: it ended before its zero was known", script);
	if (!info->complete)
		fputs(", interrupted", script);
	fprintf(script, "' at screen %g, screen %g noenhanced font large\n", LEFT,
		1 - 20.0 / figure_height());
}

static FILE *draw_recording(struct recorded *r)
{
	int top = TITLE_HEIGHT, cuts = write_cuts(r), lost[STREAMS];
	FILE *script;

	write_events(r);
	for (int i = 0; i < STREAMS; i++) {
		char *name = cli_text("%s-present.dat", streams[i].name);
		char *gone = cli_text("%s-lost.dat", streams[i].name);

		write_bins(r, r->presence[i].sample, name);
		lost[i] = write_bins(r, r->presence[i].lost, gone);
		free(name), free(gone);
	}
	script = plot_begin(r->figure->folder, r->figure->name, FIGURE_WIDTH,
			    figure_height());
	put_title(script, r);
	fprintf(script,
		"set lmargin at screen %g\nset rmargin at screen %g\n"
		"set xrange [%.9g:%.9g]\nset format x ''\n",
		LEFT, RIGHT, r->span.from_s, r->span.to_s);
	for (int i = 0; i < PANELS; i++) {
		round_range(&r->range[i]);
		put_panel(script, r, i, top, cuts, lost);
		if (!i)
			fputs("unset label 1\n", script);
		top += panels[i].height;
	}
	put_streams(script, r, top, lost);
	fputs("unset multiplot\n", script);
	return script;
}

FILE *figure_of_recording(const struct figure *figure)
{
	struct recorded *r = cli_alloc(1, sizeof(*r));
	struct incise_error err = {0};
	FILE *script;

	r->figure = figure;
	r->recording = recording_open(figure->path);
	cli_check(incise_recording_info(r->recording, &r->info, &err), &err);
	for (int i = 0; i < PANELS; i++)
		r->range[i] = (struct recording_range){INFINITY, -INFINITY};
	find_span(r);
	r->rows = r->rows_read + r->info.force + r->info.tracker + r->info.depth;
	read_force(r);
	read_depth(r);
	read_tracker(r);
	read_frames(r);
	read_events(r);
	cli_progress_end();
	script = draw_recording(r);
	incise_recording_close(r->recording);
	free(r);
	return script;
}
