// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Rows of the tracker that are not on its line; see others.h. The file is untrusted.
 */
#include <math.h>
#include <stdlib.h>
#include "others.h"
#include "source.h"

/* Numbers that are answered at once, and those that are fitted on either side. */
#define PART 32768
#define BESIDE 4096
#define TIME_MAX (INT64_MAX / 2)

struct incise_others {
	struct incise_recording *recording;
	struct incise_fit_setup setup;
	uint64_t first, last; /* numbers of the stream */
	uint64_t part;	      /* that the times are of; UINT64_MAX: none yet */
	struct incise_fit_row *rows;
	struct incise_fit_time *times;
	size_t n;
};

struct incise_others *incise_others_new(const struct incise_stream_source *source)
{
	struct incise_recording *recording = source->file;
	struct incise_others *others = calloc(1, sizeof(*others));
	int64_t seq = 0, t_ns;

	if (!others)
		return NULL;
	others->rows = malloc((PART + 2 * BESIDE) * sizeof(*others->rows));
	others->recording = recording;
	others->setup = (struct incise_fit_setup){
		.knots = source->knots,
		.n_knots = source->n_knots,
		.period_ns = source->period_ns,
		.delay_ns = llrint(source->delay_ns),
		.delay_sd_ns = isnan(source->delay_sd_ns) ? 0 : source->delay_sd_ns,
		.grain_ns = source->grain_ns,
	};
	others->part = UINT64_MAX;
	if (incise_source_end(recording, "tracker", false, &seq, &t_ns, NULL, NULL) > 0)
		others->first = (uint64_t)(seq > 0 ? seq : 0);
	if (incise_source_end(recording, "tracker", true, &seq, &t_ns, NULL, NULL) > 0)
		others->last = (uint64_t)(seq > 0 ? seq : 0);
	if (others->rows)
		return others;
	incise_others_free(others);
	return NULL;
}

void incise_others_free(struct incise_others *others)
{
	if (!others)
		return;
	free(others->rows);
	free(others->times);
	free(others);
}

/* Rows of numbers from @from to before @end, up to one that cannot be: its reader reports that. */
static size_t read_rows(struct incise_others *others, uint64_t from, uint64_t end)
{
	struct incise_source source;
	const struct incise_batch *batch = &source.batch;
	size_t n = 0;
	int rc = incise_source_open_at(&source, others->recording, INCISE_LEDGER_TRACKER,
				       (int64_t)from, NULL);

	while (!rc && incise_source_next(&source, NULL) > 0)
		for (size_t i = 0; i < batch->n && !rc; i++) {
			const uint64_t seq = (uint64_t)batch->column[0].i[i];
			const int64_t arrival_ns = batch->column[2].i[i];

			if (seq < from)
				continue;
			rc = seq >= end || arrival_ns < 0 || arrival_ns > TIME_MAX ||
			     (n && (arrival_ns < others->rows[n - 1].arrival_ns ||
				    seq <= others->rows[n - 1].seq));
			if (!rc)
				others->rows[n++] =
					(struct incise_fit_row){seq, arrival_ns};
		}
	incise_source_close(&source);
	return n;
}

static void load(struct incise_others *others, uint64_t part)
{
	const uint64_t begin = others->first + part * PART;
	const uint64_t before = begin - others->first;
	int64_t found;

	free(others->times);
	others->times = NULL;
	others->part = part;
	found = incise_fit(&others->setup, others->rows,
			   read_rows(others, begin - (before < BESIDE ? before : BESIDE),
				     begin + PART + BESIDE),
			   &others->times);
	others->n = found > 0 ? (size_t)found : 0;
}

/* The first of a part from a number on; those beside it are of other parts. */
static const struct incise_fit_time *find_from(const struct incise_others *others,
					       uint64_t seq)
{
	const uint64_t end = others->first + (others->part + 1) * PART;
	size_t low = 0, high = others->n;

	while (low < high) {
		size_t middle = low + (high - low) / 2;

		if (others->times[middle].seq < seq)
			low = middle + 1;
		else
			high = middle;
	}
	return low < others->n && others->times[low].seq < end ? &others->times[low]
							       : NULL;
}

const struct incise_fit_time *incise_others_find(struct incise_others *others,
						 uint64_t seq)
{
	const struct incise_fit_time *found;

	if (seq < others->first || seq > others->last)
		return NULL;
	if ((seq - others->first) / PART != others->part)
		load(others, (seq - others->first) / PART);
	found = find_from(others, seq);
	return found && found->seq == seq ? found : NULL;
}

/* The number of the first row from @seq on; UINT64_MAX: there is none. */
static uint64_t row_from(struct incise_others *others, uint64_t seq)
{
	struct incise_source source;
	uint64_t found = UINT64_MAX;

	if (!incise_source_open_at(&source, others->recording, INCISE_LEDGER_TRACKER,
				   (int64_t)seq, NULL) &&
	    incise_source_next(&source, NULL) > 0)
		for (size_t i = 0; i < source.batch.n && found == UINT64_MAX; i++)
			if ((uint64_t)source.batch.column[0].i[i] >= seq)
				found = (uint64_t)source.batch.column[0].i[i];
	incise_source_close(&source);
	return found;
}

const struct incise_fit_time *incise_others_next(struct incise_others *others,
						 uint64_t seq)
{
	seq = seq < others->first ? others->first : seq;
	while (seq <= others->last) {
		const uint64_t part = (seq - others->first) / PART;
		const struct incise_fit_time *found;

		if (part != others->part)
			load(others, part);
		found = find_from(others, seq);
		if (found)
			return found;
		/* Numbers may be far apart. */
		seq = row_from(others, others->first + (part + 1) * PART);
	}
	return NULL;
}
