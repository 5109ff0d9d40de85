// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tables and JSON of streams; see stream_report.h.
 */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "cli.h"
#include "json.h"
#include "stream_report.h"
#include "uncertainty.h"

const char stream_heading[] =
	"stream     rate/s      rows   lost   late jitter ms     drift ppm     offset ms";

/* "1.23", or "-" for what is not known. */
static const char *format_report_number(char *text, size_t size, double value,
					int decimals)
{
	if (isfinite(value))
		snprintf(text, size, "%.*f", decimals, value);
	else
		snprintf(text, size, "-");
	return text;
}

/* "0.31±0.12" with the digits of the sd, "0.31±?" without one; padded by columns, not bytes. */
static void put_with_sd(char *text, size_t size, double value, double sd, int decimals,
			int width)
{
	char pair[UNCERTAINTY_TEXT], known[32];
	int n = 0;

	if (isfinite(value) && sd > 0 && isfinite(sd)) {
		uncertainty_text(value, sd, "", pair);
		for (const char *c = pair; *c; c++)
			if (*c != ' ')
				pair[n++] = *c;
		pair[n] = 0;
	} else {
		snprintf(pair, sizeof(pair), "%s%s",
			 format_report_number(known, sizeof(known), value, decimals),
			 isfinite(value) ? "±?" : "");
	}
	/* ± has two bytes. */
	snprintf(text, size, "%*s", width + (strchr(pair, '\302') != NULL), pair);
}

int stream_line(const struct incise_stream *s, char *text, size_t size)
{
	char rate[32], jitter[32], drift[80], offset[80];

	put_with_sd(drift, sizeof(drift), s->drift_ppm, s->drift_sd_ppm, 2, 13);
	put_with_sd(offset, sizeof(offset), s->offset_ms, s->offset_sd_ms, 3, 13);
	return snprintf(text, size, "%-7s %9s %9llu %6llu %6llu %9s %s %s", s->name,
			format_report_number(rate, sizeof(rate), s->rate_hz, 2),
			(unsigned long long)s->rows, (unsigned long long)s->lost,
			(unsigned long long)s->late,
			format_report_number(jitter, sizeof(jitter), s->jitter_ms, 3),
			drift, offset);
}

/* Whose offsets are no surer than their devices' word. */
static void not_calibrated(const struct incise_stream *streams, int n)
{
	const char *before = "warning: no delay calibration for ";
	bool any = false;

	/* A calibration of delays is relative to a stream whose own delay it does not know. */
	for (int i = 0; i < n; i++)
		any |= !isnan(streams[i].delay_sd_ms);
	for (int i = 0; i < n; i++) {
		if (!isnan(streams[i].delay_sd_ms))
			continue;
		if (any)
			printf("warning: the delay of %s is not stated: %s_delay_sd_ms in "
			       "calibration.conf states it\n",
			       streams[i].name, streams[i].name);
		else
			printf("%s%s", before, streams[i].name);
		before = ", ";
	}
	if (*before == ',' && !any)
		puts(" (run 'incise calibrate delay')");
}

void stream_table(const struct incise_stream *streams, int n)
{
	char line[200];

	if (n)
		puts(stream_heading);
	for (int i = 0; i < n; i++) {
		stream_line(&streams[i], line, sizeof(line));
		puts(line);
	}
	not_calibrated(streams, n);
	for (int i = 0; i < n; i++) {
		if (*streams[i].note)
			printf("warning: %s: %s\n", streams[i].name, streams[i].note);
		if (*streams[i].ended)
			printf("%s ended: %s\n", streams[i].name, streams[i].ended);
	}
}

json_t *stream_json(const struct incise_stream *streams, int n)
{
	json_t *array = json_array();

	for (int i = 0; i < n && array; i++) {
		const struct incise_stream *s = &streams[i];

		json_array_append_new(
			array,
			json_pack(
				"{so so so sb so so so sI sI sI so so so so so so so so}",
				"note", json_text_or_null(s->note), "name",
				json_text(s->name), "device", json_text(s->device),
				"stamped", s->timestamped, "nominal_hz",
				json_number(s->nominal_hz), "delay_ms",
				json_number(s->delay_ms), "delay_sd_ms",
				json_number(s->delay_sd_ms), "rows", (json_int_t)s->rows,
				"lost", (json_int_t)s->lost, "late", (json_int_t)s->late,
				"rate_hz", json_number(s->rate_hz), "drift_ppm",
				json_number(s->drift_ppm), "drift_sd_ppm",
				json_number(s->drift_sd_ppm), "jitter_ms",
				json_number(s->jitter_ms), "jitter_max_ms",
				json_number(s->jitter_max_ms), "offset_ms",
				json_number(s->offset_ms), "offset_sd_ms",
				json_number(s->offset_sd_ms), "ended",
				json_text_or_null(s->ended)));
	}
	return array;
}

json_t *pose_json(const struct incise_pose_counts *poses)
{
	json_t *flags = json_object();

	for (int i = 0; i < 128; i++)
		if (poses->flagged[i])
			json_object_set_new(flags, (char[]){(char)i, 0},
					    json_integer((json_int_t)poses->flagged[i]));
	return json_pack("{sI sI so}", "taken", (json_int_t)poses->poses, "unusable",
			 (json_int_t)poses->unusable, "flags", flags);
}
