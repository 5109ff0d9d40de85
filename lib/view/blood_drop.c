// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Drops of blood; see blood_drop.h.
 */
#include <math.h>
#include "blood_drop.h"
#include "blood_drop_shape.h"
#include "grain.h"

#define STEP_S 0.01
/* mN, mm, s: weight of a µl; surface tension of blood; its capillary length. */
#define WEIGHT 0.0104
#define TENSION 0.055
#define CAPILLARY_MM 2.3
/* V / r³ of a cap of 50°. */
#define CAP 0.786
/* Difference of the cosines of the advancing and the receding angle, on dry skin. */
#define HYSTERESIS 0.05
/* Part of it that is left on wet skin, and while a drop moves. */
#define WET 0.7
#define MOVING 0.75
/* C of the drag: some 6 ln(r / slip length) / angle, both sides of the wedge. */
#define DRAG 110.0
#define SPEED_MAX_MM_S 150.0
#define SPEED_LEAST_MM_S 0.3
/* Time in which a drop takes up its speed, and turns. */
#define RELAX_S 0.08
/* Blood in a drop is as thick again at this age. */
#define CLOT_S 25.0
/* The film behind, mm; it is narrower than the drop. */
#define FILM_LEAST_MM 0.06
#define FILM_MOST_MM 0.22
#define FILM_WIDTH 0.8
/* A spot of it for each such part of its radius. */
#define FILM_EACH 0.3
/* In a slow film blood is more viscous than in the drop: it thins by shear. */
#define FILM_THICKER 1.7
/* Skin is rough over this length; by so much (tangent) it turns a drop at most. */
#define ROUGH_MM 2.6
#define ROUGH 0.55
#define TURN_MOST 0.9
/* Wetter skin beside the way draws it over: tangent. */
#define DRAWN 0.5
#define WET_MM 0.004
/* Overlapping by so much of their radii drops flow together, by this part in a step. */
#define TOUCH 0.72
#define FLOW 0.12
/* Pinned for so long a drop sinks in, by this part in a step; what is less is film. */
#define PINNED_S 4.0
#define SINK 0.006
#define LEAST_UNITS (int64_t)(0.03 / BLOOD_UNIT_UL)
/* How a drop looks is seen to in each so many steps, not in all drops at once. */
#define SHOWN_EACH 3

void drops_init(struct drops *drops, struct film *film,
		const struct incise_scene_picture *picture, uint32_t key)
{
	*drops = (struct drops){.film = film, .key = key};
	drops->viscosity = picture->viscosity_mPa_s * 1e-6;
}

double drop_radius_mm(int64_t units)
{
	return cbrt((double)units * (BLOOD_UNIT_UL / CAP));
}

int drops_new(struct drops *drops, const double px[2], const double along_px[2],
	      int source, int64_t units)
{
	struct ground ground;

	if (!ground_at(drops->film->chart, drops->film->gravity, px, &ground))
		return -1;
	for (int i = 0; i < DROPS_MAX; i++) {
		struct drop *drop = &drops->drop[i];

		if (drop->units)
			continue;
		*drop = (struct drop){
			.units = units,
			.px = {px[0], px[1]},
			.heading = {1, 0},
			.source = source,
			.metric = ground.metric,
			.axis_px = {along_px[0], along_px[1]},
			.before = DROP_HANGS_ALONG,
			.behind = DROP_HANGS_ALONG,
			.beside = DROP_HANGS_ACROSS,
		};
		return i;
	}
	return -1;
}

static void vanish(struct drops *drops, struct drop *drop)
{
	drops_mark(drops, drop);
	drop->units = 0;
	drop->drawn_mm = 0;
}

/* How wet it is at a place ahead, in mm along and across downhill; 0 … 1. */
static double wet_at(struct drops *drops, const struct drop *drop,
		     const struct ground *ground, double along, double across)
{
	double x =
		drop->px[0] + along * ground->down_px[0] + across * ground->across_px[0];
	double y =
		drop->px[1] + along * ground->down_px[1] + across * ground->across_px[1];

	return fmin(film_thickness_mm(drops->film, x, y) / WET_MM, 1);
}

/* Downhill, off to a side by the skin's roughness and by what is wet already. */
static void steer(struct drops *drops, struct drop *drop, const struct ground *ground,
		  double radius)
{
	double mm_x = drop->px[0] * ground->metric.a,
	       mm_y = drop->px[1] * ground->metric.c;
	double rough = noise_smooth(drops->key, (float)(mm_x / ROUGH_MM),
				    (float)(mm_y / ROUGH_MM)) +
		       0.5 * noise_smooth(drops->key + 1, (float)(mm_x / ROUGH_MM * 2.7),
					  (float)(mm_y / ROUGH_MM * 2.7));
	double right = wet_at(drops, drop, ground, 1.1 * radius, 1.2 * radius);
	double left = wet_at(drops, drop, ground, 1.1 * radius, -1.2 * radius);
	double turn = ROUGH * rough + DRAWN * (right - left);
	double length;

	turn = fmin(fmax(turn, -TURN_MOST), TURN_MOST);
	drop->heading[1] += (turn - drop->heading[1]) * (STEP_S / RELAX_S);
	drop->heading[0] = 1;
	length = sqrt(1 + drop->heading[1] * drop->heading[1]);
	drop->heading[0] /= length;
	drop->heading[1] /= length;
}

/* The steepest that the drop's foot feels: where it hangs over, on what curves down. */
static double slope_of(struct drops *drops, const struct drop *drop,
		       const struct ground *ground, double radius)
{
	double px[2] = {drop->px[0] + radius * ground->down_px[0],
			drop->px[1] + radius * ground->down_px[1]};
	struct ground front;

	if (!ground_at(drops->film->chart, drops->film->gravity, px, &front))
		return ground->slope;
	return fmax(ground->slope, front.slope);
}

static void accelerate(struct drops *drops, struct drop *drop,
		       const struct ground *ground, double radius)
{
	double ahead = wet_at(drops, drop, ground, 1.15 * radius, 0);
	double volume = (double)drop->units * BLOOD_UNIT_UL;
	double held = TENSION * HYSTERESIS * 2 * radius * (1 - (1 - WET) * ahead);
	double clot = 1 + drop->age_s * drop->age_s / (CLOT_S * CLOT_S);
	double drives, to;

	if (drop->speed_mm_s > 0)
		held *= MOVING;
	/* Clotting blood holds on: its edge more than its inside. */
	drives = WEIGHT * volume * slope_of(drops, drop, ground, radius) - held * clot;
	to = fmax(drives, 0) / (DRAG * drops->viscosity * clot * 2 * radius);
	to = fmin(to, SPEED_MAX_MM_S);
	drop->speed_mm_s += (to - drop->speed_mm_s) * (STEP_S / RELAX_S);
	if (drop->speed_mm_s < SPEED_LEAST_MM_S)
		drop->speed_mm_s = to > SPEED_LEAST_MM_S ? SPEED_LEAST_MM_S : 0;
}

/*
 * What a drop leaves on its way, or takes up from what is thicker: a spot for each part of
 * the spot's radius, so that a slow drop costs no more than its way.
 */
static void leave_film(struct drops *drops, struct drop *drop, double radius)
{
	double capillary = drops->viscosity * drop->speed_mm_s / TENSION;
	double thick = 0.94 * CAPILLARY_MM * cbrt(capillary * capillary);
	double width = FILM_WIDTH * radius, share;

	if (drop->way_mm < FILM_EACH * width)
		return;
	share = 1 - exp(-drop->way_mm / (0.4 * width));
	drop->way_mm = 0;
	thick = fmin(fmax(FILM_THICKER * thick, FILM_LEAST_MM), FILM_MOST_MM);
	drop->units -=
		film_level(drops->film, drop->px, width, thick, share, drop->units);
}

static void run(struct drops *drops, struct drop *drop, const struct ground *ground,
		double radius)
{
	double way = drop->speed_mm_s * STEP_S;

	drop->way_mm += way;
	leave_film(drops, drop, radius);
	for (int i = 0; i < 2; i++)
		drop->px[i] += way * (drop->heading[0] * ground->down_px[i] +
				      drop->heading[1] * ground->across_px[i]);
	if (drop->source >= 0)
		drop_turn_round(drop, ground);
	drop->source = -1;
}

/* Into the film below. */
static void sink(struct drops *drops, struct drop *drop, double radius, int64_t units)
{
	film_add(drops->film, drop->px, radius, units);
	drop->units -= units;
}

static void step_drop(struct drops *drops, struct drop *drop)
{
	struct ground ground;
	double radius = drop_radius_mm(drop->units);

	if (!ground_at(drops->film->chart, drops->film->gravity, drop->px, &ground)) {
		drops->film->off_units += drop->units;
		vanish(drops, drop);
		return;
	}
	drop->metric = ground.metric;
	if (drop->source < 0)
		drop->age_s += STEP_S;
	accelerate(drops, drop, &ground, radius);
	if (drop->speed_mm_s > 0) {
		steer(drops, drop, &ground, radius);
		run(drops, drop, &ground, radius);
	} else if (drop->source < 0 && drop->age_s > PINNED_S) {
		sink(drops, drop, radius, (int64_t)((double)drop->units * SINK));
	}
	if (drop->source < 0 && drop->units < LEAST_UNITS)
		sink(drops, drop, radius, drop->units);
	if (drop->units &&
	    (drops->film->step + (uint64_t)(drop - drops->drop)) % SHOWN_EACH)
		return;
	if (drop->units)
		drops_show(drops, drop, &ground);
	else
		vanish(drops, drop);
}

/* The smaller of two that touch flows into the larger. */
static void merge(struct drops *drops, struct drop *a, struct drop *b)
{
	struct drop *to = a->units >= b->units ? a : b, *from = to == a ? b : a;
	int64_t units = (int64_t)((double)from->units * FLOW) + 1;
	double part;

	if (from->units < LEAST_UNITS || units > from->units)
		units = from->units;
	if ((double)(to->units + units) * BLOOD_UNIT_UL > DROP_MOST_UL)
		return;
	/* The mixture is as old as its parts. */
	part = (double)units / (double)(units + to->units);
	to->age_s += (from->age_s - to->age_s) * part;
	to->units += units;
	from->units -= units;
	if (!from->units)
		vanish(drops, from);
}

/* Drops whose edges touch, by where they were at the beginning. */
static void merge_all(struct drops *drops)
{
	struct drop *live[DROPS_MAX];
	double radius[DROPS_MAX];
	int n = 0;

	for (int i = 0; i < DROPS_MAX; i++) {
		struct drop *drop = &drops->drop[i];

		if (!drop->units)
			continue;
		radius[n] = drop_radius_mm(drop->units);
		live[n++] = drop;
	}
	for (int i = 0; i < n; i++)
		for (int j = i + 1; j < n; j++) {
			struct drop *a = live[i], *b = live[j];

			if (a->units && b->units &&
			    ground_length_mm(&a->metric, b->px[0] - a->px[0],
					     b->px[1] - a->px[1]) <
				    TOUCH * (radius[i] + radius[j]))
				merge(drops, a, b);
		}
}

void drops_step(struct drops *drops)
{
	for (int i = 0; i < DROPS_MAX; i++)
		if (drops->drop[i].units)
			step_drop(drops, &drops->drop[i]);
	merge_all(drops);
}

int64_t drops_units(const struct drops *drops)
{
	int64_t units = 0;

	for (int i = 0; i < DROPS_MAX; i++)
		units += drops->drop[i].units;
	return units;
}

int drops_count(const struct drops *drops)
{
	int n = 0;

	for (int i = 0; i < DROPS_MAX; i++)
		n += drops->drop[i].units > 0;
	return n;
}
