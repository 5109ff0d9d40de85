// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Drops of blood; see blood_drop.h.
 */
#include <math.h>
#include "blood_drop.h"
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
/* A change that is seen, in mm. */
#define SEEN_MM 0.04
/* It is looked for in each so many steps, not in all drops at once. */
#define SHOWN_EACH 3
#define SEEN 0.03
/* 1 / sqrt(1 - FILM_ROUGH), rounded up. */
#define ROUGHEST 1.2
/* Shapes of drops, in radii of a round one, and by what part they change when shown. */
#define HANGS_ALONG 1.7
#define HANGS_ACROSS 0.7
#define TURNS_INTO 0.22

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

bool drop_box(const struct film *film, const struct drop *drop, struct drop_box *box)
{
	struct ground_metric *m = &box->metric;
	double u, v, length, along, beside, half_u, half_v, half_x;

	if (!(drop->drawn_mm > 0) || !ground_metric(film->chart, drop->drawn_px, m))
		return false;
	u = m->a * drop->axis_px[0] + m->b * drop->axis_px[1];
	v = m->c * drop->axis_px[1];
	length = sqrt(u * u + v * v);
	box->axis[0] = length > 0 ? u / length : 0;
	box->axis[1] = length > 0 ? v / length : 1;
	/* Of the ellipse that holds both halves, at its roughest. */
	along = drop->drawn_mm * fmax(drop->before, drop->behind) * ROUGHEST;
	beside = drop->drawn_mm * drop->beside * ROUGHEST;
	half_u = hypot(along * box->axis[0], beside * box->axis[1]);
	half_v = hypot(along * box->axis[1], beside * box->axis[0]);
	half_x = (half_u + half_v * fabs(m->b) / m->c) / m->a;
	box->left = (int)floor(drop->drawn_px[0] - half_x);
	box->right = (int)floor(drop->drawn_px[0] + half_x);
	box->top = (int)floor(drop->drawn_px[1] - half_v / m->c);
	box->bottom = (int)floor(drop->drawn_px[1] + half_v / m->c);
	return true;
}

static void mark(struct drops *drops, const struct drop *drop)
{
	struct drop_box box;

	if (drop_box(drops->film, drop, &box))
		film_mark(drops->film, box.left, box.top, box.right, box.bottom);
}

static bool nearer(double *value, double to)
{
	if (fabs(*value - to) < SEEN)
		return false;
	*value += (to - *value) * TURNS_INTO;
	return true;
}

/*
 * What is drawn follows when it would be seen; always by the drops' own steps. A drop that
 * hangs lies along its cut; one that runs has a round head and is drawn out behind.
 */
static void show(struct drops *drops, struct drop *drop, const struct ground *ground)
{
	double radius = drop_radius_mm(drop->units);
	double moved = ground_length_mm(&ground->metric, drop->px[0] - drop->drawn_px[0],
					drop->px[1] - drop->drawn_px[1]);
	double fast = fmin(drop->speed_mm_s / 15, 1);
	struct drop is = *drop;
	bool other;

	if (drop->source < 0) {
		other = nearer(&is.before, 0.8);
		other = nearer(&is.behind, 0.9 + 1.6 * fast) || other;
		other = nearer(&is.beside, 0.9 - 0.25 * fast) || other;
		for (int i = 0; i < 2 && drop->speed_mm_s > 0; i++)
			is.axis_px[i] = drop->heading[0] * ground->down_px[i] +
					drop->heading[1] * ground->across_px[i];
	} else {
		other = false;
	}
	if (!other && fabs(radius - drop->drawn_mm) < SEEN_MM && moved < SEEN_MM)
		return;
	mark(drops, drop);
	*drop = is;
	drop->drawn_mm = radius;
	drop->drawn_px[0] = drop->px[0];
	drop->drawn_px[1] = drop->px[1];
	mark(drops, drop);
}

/* It leaves its cut: the same shape, seen along another axis. */
static void turn_round(struct drop *drop, const struct ground *ground)
{
	const struct ground_metric *m = &ground->metric;
	double u = m->a * drop->axis_px[0] + m->b * drop->axis_px[1];
	double v = m->c * drop->axis_px[1], length = sqrt(u * u + v * v);
	double a = m->a * ground->down_px[0] + m->b * ground->down_px[1];
	double b = m->c * ground->down_px[1], along, across;

	if (!(length > 0))
		return;
	along = fabs(u * a + v * b) / length;
	across = sqrt(fmax(1 - along * along, 0));
	drop->before = drop->behind = along * HANGS_ALONG + across * HANGS_ACROSS;
	drop->beside = along * HANGS_ACROSS + across * HANGS_ALONG;
	drop->axis_px[0] = ground->down_px[0];
	drop->axis_px[1] = ground->down_px[1];
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
			.before = HANGS_ALONG,
			.behind = HANGS_ALONG,
			.beside = HANGS_ACROSS,
		};
		return i;
	}
	return -1;
}

static void vanish(struct drops *drops, struct drop *drop)
{
	mark(drops, drop);
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
		turn_round(drop, ground);
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
		show(drops, drop, &ground);
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
