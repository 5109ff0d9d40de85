// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Blood from fresh cuts; see blood.h.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include "../base/random.h"
#include "blood.h"
#include "blood_drop.h"
#include "blood_film.h"
#include "blood_paint.h"
#include "grain.h"

#define STEP_S 0.01
/* A source stands for so much of a cut, mm: a random length between these. */
#define SPAN_LEAST_MM 2.5
#define SPAN_MOST_MM 8.0
/* The wound is wet first, to this thickness, by spots of that radius. */
#define WETS_MM 0.16
#define SPOT_MM 0.55
#define WETS_SHARE 0.5
/* A source gives every so many steps, each at its own time. */
#define EMIT_STEPS 8
/* What an instrument that goes in opens again, of all that bled at first; within this, mm. */
#define REOPENS 0.5
#define REOPENS_MM 9.0
#define REOPENS_DEPTH_MM 2.0
/* Below this, µl/s, it has stopped. */
#define STOPPED_UL_S 1e-3

struct source {
	double from_px[2], to_px[2]; /* of what it stands for */
	double at_px[2];	     /* where its drop hangs */
	double length_mm, span_mm, at_mm;
	double first_ul_s; /* all that it bled when fresh */
	double ul_s;	   /* now */
	double carry;	   /* of a unit */
	int drop;	   /* or -1 */
	double drop_mm;	   /* its radius when it was last moved */
};

struct blood {
	struct film film;
	struct drops drops;
	double ul_s_mm2;
	uint64_t key, drawn; /* of random numbers, and how many there were */
	int64_t emitted;
	int n, last; /* sources; the one that grows, or -1 */
	struct source source[BLOOD_SOURCES_MAX];
};

static double draw(struct blood *blood)
{
	return incise_random_uniform(blood->key, blood->drawn++);
}

struct blood *blood_new(const struct incise_chart *chart,
			const struct incise_scene_picture *picture,
			struct incise_error *err)
{
	struct blood *blood = calloc(1, sizeof(*blood));

	if (!blood || !film_init(&blood->film, chart, picture)) {
		blood_free(blood);
		incise_error_set(err, ENOMEM, "view: no memory for blood");
		return NULL;
	}
	blood->key = incise_random_bits(0x626c6f6f64, (uint64_t)(int64_t)picture->seed);
	blood->ul_s_mm2 = picture->blood_ul_s_mm2;
	blood->last = -1;
	drops_init(&blood->drops, &blood->film, picture, (uint32_t)blood->key);
	return blood;
}

void blood_free(struct blood *blood)
{
	if (!blood)
		return;
	film_free(&blood->film);
	free(blood);
}

/* Room for a source: a free one, or that which bleeds least. */
static int room(const struct blood *blood)
{
	int least = 0;

	if (blood->n < BLOOD_SOURCES_MAX)
		return blood->n;
	for (int i = 1; i < blood->n; i++)
		if (blood->source[i].ul_s < blood->source[least].ul_s)
			least = i;
	return least;
}

static struct source *begin(struct blood *blood, const struct wound_stroke *stroke)
{
	int number = room(blood);
	struct source *source = &blood->source[number];

	/* Its drop, if it had one, goes its own way. */
	if (number < blood->n && source->drop >= 0 &&
	    blood->drops.drop[source->drop].source == number)
		blood->drops.drop[source->drop].source = -1;
	if (number == blood->n)
		blood->n++;
	*source = (struct source){
		.from_px = {stroke->from_px[0], stroke->from_px[1]},
		.at_px = {stroke->to_px[0], stroke->to_px[1]},
		.span_mm = SPAN_LEAST_MM + (SPAN_MOST_MM - SPAN_LEAST_MM) * draw(blood),
		.drop = -1,
	};
	source->at_mm = source->span_mm * draw(blood);
	blood->last = number;
	return source;
}

void blood_stroke(struct blood *blood, const struct wound_stroke *stroke)
{
	struct source *source = blood->last >= 0 ? &blood->source[blood->last] : NULL;
	double ul_s = blood->ul_s_mm2 * stroke->length_mm * stroke->fresh_mm;

	if (!(ul_s > 0))
		return;
	if (!source || stroke->begins || source->length_mm >= source->span_mm)
		source = begin(blood, stroke);
	source->length_mm += stroke->length_mm;
	source->to_px[0] = stroke->to_px[0];
	source->to_px[1] = stroke->to_px[1];
	if (source->length_mm - stroke->length_mm < source->at_mm && source->drop < 0) {
		source->at_px[0] = stroke->to_px[0];
		source->at_px[1] = stroke->to_px[1];
	}
	source->first_ul_s += ul_s;
	source->ul_s += ul_s;
}

void blood_reopen(struct blood *blood, const double px[2], double depth_mm)
{
	double in = fmin(depth_mm / REOPENS_DEPTH_MM, 1);
	struct ground_metric metric;

	if (!(in > 0) || !ground_metric(blood->film.chart, px, &metric))
		return;
	for (int i = 0; i < blood->n; i++) {
		struct source *source = &blood->source[i];
		double off = ground_length_mm(&metric, source->at_px[0] - px[0],
					      source->at_px[1] - px[1]) /
			     REOPENS_MM;

		if (off < 1)
			source->ul_s = fmax(source->ul_s, source->first_ul_s * REOPENS *
								  in * (1 - off * off));
	}
}

/* Some of it wets the cut; returns how much. */
static int64_t wet(struct blood *blood, int number, int64_t units)
{
	const struct source *source = &blood->source[number];
	double t = draw(blood), px[2];

	for (int i = 0; i < 2; i++)
		px[i] = source->from_px[i] + t * (source->to_px[i] - source->from_px[i]);
	return film_level(&blood->film, px, SPOT_MM * (0.7 + 0.6 * draw(blood)), WETS_MM,
			  0.3, (int64_t)((double)units * WETS_SHARE));
}

/* A drop hangs below the place it comes from, lower the larger it is. */
static void hang(struct blood *blood, struct source *source, struct drop *drop)
{
	double radius = drop_radius_mm(drop->units),
	       lower = 0.55 * (radius - source->drop_mm);
	struct ground ground;

	if (!(lower > 0) ||
	    !ground_at(blood->film.chart, blood->film.gravity, drop->px, &ground))
		return;
	source->drop_mm = radius;
	for (int i = 0; i < 2; i++)
		drop->px[i] += lower * ground.down_px[i];
}

static void feed(struct blood *blood, int number, int64_t units)
{
	struct source *source = &blood->source[number];
	struct drop *drop = source->drop >= 0 ? &blood->drops.drop[source->drop] : NULL;
	double along[2];

	if (drop && drop->units && drop->source == number) {
		if ((double)drop->units * BLOOD_UNIT_UL > DROP_MOST_UL)
			drop->source = -1;
	}
	if (drop && drop->units && drop->source == number) {
		drop->units += units;
		hang(blood, source, drop);
		return;
	}
	for (int i = 0; i < 2; i++)
		along[i] = source->to_px[i] - source->from_px[i];
	source->drop = drops_new(&blood->drops, source->at_px, along, number, units);
	source->drop_mm = 0;
	if (source->drop < 0)
		film_add(&blood->film, source->at_px, SPOT_MM, units);
}

static void emit(struct blood *blood, int number)
{
	struct source *source = &blood->source[number];
	double units =
		source->ul_s * (EMIT_STEPS * STEP_S / BLOOD_UNIT_UL) + source->carry;
	int64_t whole = (int64_t)units;
	int64_t left;

	source->carry = units - (double)whole;
	source->ul_s *= exp(-EMIT_STEPS * STEP_S / BLOOD_CLOT_S);
	if (whole <= 0)
		return;
	blood->emitted += whole;
	left = whole - wet(blood, number, whole);
	/* More when a spot that was too thick was spread. */
	if (left > 0)
		feed(blood, number, left);
}

void blood_step(struct blood *blood)
{
	for (int i = 0; i < blood->n; i++) {
		struct source *source = &blood->source[i];

		if ((blood->film.step + (uint64_t)i * 3) % EMIT_STEPS)
			continue;
		if (source->ul_s > STOPPED_UL_S) {
			emit(blood, i);
		} else if (source->drop >= 0) {
			/* It hangs no longer at what does not bleed. */
			if (blood->drops.drop[source->drop].source == i)
				blood->drops.drop[source->drop].source = -1;
			source->drop = -1;
		}
	}
	drops_step(&blood->drops);
	film_step(&blood->film);
}

void blood_paint(struct blood *blood, struct incise_canvas *canvas, int layer)
{
	blood_paint_layer(&blood->film, &blood->drops, canvas, layer);
}

void blood_volumes(const struct blood *blood, struct blood_volumes *volumes)
{
	*volumes = (struct blood_volumes){
		.emitted = blood->emitted,
		.drops = drops_units(&blood->drops),
		.films = blood->film.units,
		.off = blood->film.off_units,
		.n_drops = drops_count(&blood->drops),
	};
}

bool blood_drop(const struct blood *blood, int index, double px[2], double *ul)
{
	const struct drop *drop;

	if (index < 0 || index >= DROPS_MAX || !blood->drops.drop[index].units)
		return false;
	drop = &blood->drops.drop[index];
	px[0] = drop->px[0];
	px[1] = drop->px[1];
	*ul = (double)drop->units * BLOOD_UNIT_UL;
	return true;
}

size_t blood_memory(const struct blood *blood)
{
	return sizeof(*blood) + film_memory(&blood->film);
}
