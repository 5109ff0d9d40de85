// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Blood from fresh cuts: its drops, its sources and its colour; see blood.h.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "../base/random.h"
#include "blood.h"
#include "blood_film.h"
#include "noise.h"

#define STEP_S 0.01

/*
 * Drops hang at the wound and grow, run when their weight overcomes the hold of their edge, leave a
 * film behind, and merge.
 *
 *      ╷╷╷  film, Landau and Levich: h = 0.94 lc (mu v / gamma)^(2/3)
 *      ╷╷╷
 *     ╭───╮   weight along the surface   rho g V s         s: sine of the slope
 *     │   │   held at the edge           gamma dcos 2 r    Furmidge; less on wet skin
 *     ╰───╯   viscous drag               C mu v 2 r        Kim, Lee and Kang 2002
 *       ▼
 *
 * A drop of volume V is a cap with a contact angle of 50°: V = 0.79 r³. Its weight grows with r³,
 * its hold with r: so each slope has a volume below which drops are pinned, some µl. Above it, the
 * speed is the remaining weight over the drag. Blood stiffens as it clots. A drop that stays pinned
 * sinks into the film below it.
 */
#define DROPS_MAX 128
/* No drop grows beyond that, µl. */
#define DROP_MOST_UL 60.0

struct drop {
	int64_t units; /* 0: there is no drop */
	double px[2];
	double heading[2];	     /* unit, along and across downhill */
	double speed_mm_s;	     /* 0: pinned */
	struct ground_metric metric; /* at its place */
	double age_s;
	double way_mm; /* since it last left film */
	double ran_mm; /* since it left its source */
	double clings; /* factor of its hold: drops and skin differ */
	double wet;    /* of the skin ahead, 0 … 1 */
	int source;    /* that feeds it, or -1 */

	/*
	 * As drawn, which follows only visible changes. Lengths of its shape are in radii of
	 * a round one: before, behind, to the sides of its axis.
	 */
	double drawn_px[2], drawn_mm, axis_px[2], before, behind, beside;
};

struct drops {
	struct film *film;
	uint32_t key;	  /* of the skin's roughness */
	uint64_t drawn;	  /* drops so far */
	double viscosity; /* mN s/mm² */
	struct drop drop[DROPS_MAX];
};

/* mN, mm, s: weight of a µl; surface tension of blood; its capillary length. */
#define WEIGHT 0.0104
#define TENSION 0.055
#define CAPILLARY_MM 2.3
/* V / r³ of a cap of 50°. */
#define CAP 0.786
/* Difference of the cosines of the advancing and the receding angle, on dry skin. */
#define HYSTERESIS 0.05
/* Remaining part of it on wet skin, and while a drop moves. */
#define WET 0.7
#define MOVING 0.75
/* C of the drag: some 6 ln(r / slip length) / angle, both sides of the wedge. */
#define DRAG 110.0
#define SPEED_MAX_MM_S 150.0
#define SPEED_LEAST_MM_S 0.3
/* Time constant of speed and heading. */
#define RELAX_S 0.08
/* The viscosity of a drop doubles at this age. */
#define CLOT_S 25.0
/* The film behind, mm; it is narrower than the drop. */
#define FILM_LEAST_MM 0.06
#define FILM_MOST_MM 0.22
#define FILM_WIDTH 0.8
/* Its width varies with the skin, over such lengths. */
#define FILM_UNEVEN 0.35
#define FILM_UNEVEN_MM 6.0
/* A spot of it for each such part of its radius. */
#define FILM_EACH 0.3
/* Blood thins by shear: in a slow film it is more viscous than in the drop. */
#define FILM_THICKER 1.7
/* The hold of drops is between these times that, at random; on wet skin a drop keeps its shape less. */
#define CLINGS_LEAST 0.45
#define CLINGS_MOST 1.9
/* A drop on wet skin leaves a film so many times thicker, and sinks into it when pinned. */
#define WET_THICKER 1.6
#define WET_SINK 0.03
/* Length of the skin's roughness; effect on the heading, and its maximum (tangent). */
#define ROUGH_MM 4.5
#define ROUGH 0.42
#define TURN_MOST 0.9
/* Wetter skin to one side attracts it: tangent. */
#define DRAWN 0.5
#define WET_MM 0.004
/* Drops closer than this part of their radii merge, by this part in a step. */
#define TOUCH 0.72
#define FLOW 0.12
/* A pinned drop sinks in after this time, by this part in a step, or all at once. */
#define PINNED_S 4.0
#define SINK 0.006
#define LEAST_UNITS (int64_t)(0.03 / BLOOD_UNIT_UL)
/* The shape of each drop is updated every so many steps, in turns. */
#define SHOWN_EACH 3
#define SHOWN_EACH_WET 9

/* A hanging drop lies along its cut; in radii of a round one. */
#define DROP_HANGS_ALONG 1.7
#define DROP_HANGS_ACROSS 0.7

/* A drop as drawn; from … to: its texels. */
struct shape {
	struct ground_metric metric;
	float x, y, axis[2];	      /* axis: unit, mm, along its way */
	float before, behind, beside; /* 1/mm */
	float high_mm, grain;
	int from_px[2], to_px[2]; /* to_px is exclusive */
};

/* Visible changes: mm, and radii; so many times that for a swelling of wet skin. */
#define SEEN_MM 0.04
#define SEEN 0.03
#define SEEN_WET 30
/* 1 / sqrt(1 - FILM_ROUGH), rounded up. */
#define ROUGHEST 1.2
/* Part of the way that a shape changes per update. */
#define TURNS_INTO 0.22

static double drop_radius_mm(int64_t units)
{
	return cbrt((double)units * (BLOOD_UNIT_UL / CAP));
}

static bool drop_shape(const struct film *film, const struct drop *drop,
		       struct shape *shape)
{
	struct ground_metric *m = &shape->metric;
	double u, v, length, axis[2], along, beside, half_u, half_v, half[2];

	if (!(drop->drawn_mm > 0) || !ground_metric(film->map, drop->drawn_px, m))
		return false;
	u = m->a * drop->axis_px[0] + m->b * drop->axis_px[1];
	v = m->c * drop->axis_px[1];
	length = sqrt(u * u + v * v);
	axis[0] = length > 0 ? u / length : 0;
	axis[1] = length > 0 ? v / length : 1;
	/* The ellipse around both halves, at its roughest. */
	along = drop->drawn_mm * fmax(drop->before, drop->behind) * ROUGHEST;
	beside = drop->drawn_mm * drop->beside * ROUGHEST;
	half_u = hypot(along * axis[0], beside * axis[1]);
	half_v = hypot(along * axis[1], beside * axis[0]);
	half[0] = (half_u + half_v * fabs(m->b) / m->c) / m->a;
	half[1] = half_v / m->c;
	for (int i = 0; i < 2; i++) {
		shape->axis[i] = (float)axis[i];
		shape->from_px[i] = (int)floor(drop->drawn_px[i] - half[i]);
		shape->to_px[i] = (int)floor(drop->drawn_px[i] + half[i]) + 1;
	}
	shape->x = (float)drop->drawn_px[0];
	shape->y = (float)drop->drawn_px[1];
	shape->before = (float)(1 / (drop->drawn_mm * drop->before));
	shape->behind = (float)(1 / (drop->drawn_mm * drop->behind));
	shape->beside = (float)(1 / (drop->drawn_mm * drop->beside));
	/* The volume is the drop's: the mean of (1 - r²)^1.5 over a disc is 0.4. */
	shape->high_mm = (float)(0.625 * drop->drawn_mm * 2 /
				 (drop->beside * (drop->before + drop->behind)));
	shape->grain = m->a / FILM_ROUGH_MM;
	return true;
}

/* The drop's texels are to be painted. */
static void drops_mark(struct drops *drops, const struct drop *drop)
{
	struct shape shape;

	if (drop_shape(drops->film, drop, &shape))
		canvas_tiles_mark_texels(&drops->film->tiles, shape.from_px[0],
					 shape.from_px[1], shape.to_px[0] - 1,
					 shape.to_px[1] - 1);
}

static bool nearer(double *value, double to, double seen)
{
	if (fabs(*value - to) < seen)
		return false;
	*value += (to - *value) * TURNS_INTO;
	return true;
}

/*
 * Update the shape as drawn, if the change is visible. A hanging drop lies along its cut; a running
 * one has a round head and a tail.
 */
static void drops_show(struct drops *drops, struct drop *drop,
		       const struct ground *ground)
{
	double radius = drop_radius_mm(drop->units);
	double moved = ground_length_mm(&ground->metric, drop->px[0] - drop->drawn_px[0],
					drop->px[1] - drop->drawn_px[1]);
	double fast = fmin(drop->speed_mm_s / 15, 1);
	struct drop is = *drop;
	/* Large changes of hardly visible parts are followed at once, small changes not at all. */
	double blurs = drop->source < 0 ? 1 + (SEEN_WET - 1) * drop->wet * drop->wet : 1;
	double seen = SEEN * fmin(blurs, 4);
	bool other = false;

	if (drop->source < 0) {
		/* On wet skin it is a swelling of the film, not a bead. */
		other = nearer(&is.before, 0.8 + 1.3 * drop->wet, seen);
		other = nearer(&is.behind,
			       0.9 + fmin(1.6 * fast + 2.8 * drop->wet,
					  0.8 * drop->ran_mm / radius),
			       seen) ||
			other;
		other = nearer(&is.beside, 0.9 - 0.25 * fast, seen) || other;
		for (int i = 0; i < 2 && drop->speed_mm_s > 0; i++)
			is.axis_px[i] = drop->heading[0] * ground->down_px[i] +
					drop->heading[1] * ground->across_px[i];
	}
	if (!other && fabs(radius - drop->drawn_mm) < SEEN_MM * fmin(blurs, 4) &&
	    moved < SEEN_MM * blurs)
		return;
	drops_mark(drops, drop);
	*drop = is;
	drop->drawn_mm = radius;
	drop->drawn_px[0] = drop->px[0];
	drop->drawn_px[1] = drop->px[1];
	drops_mark(drops, drop);
}

/* The drop leaves its cut: the same shape along another axis. */
static void drop_turn_round(struct drop *drop, const struct ground *ground)
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
	drop->before = drop->behind =
		along * DROP_HANGS_ALONG + across * DROP_HANGS_ACROSS;
	drop->beside = along * DROP_HANGS_ACROSS + across * DROP_HANGS_ALONG;
	drop->axis_px[0] = ground->down_px[0];
	drop->axis_px[1] = ground->down_px[1];
}

static void drops_init(struct drops *drops, struct film *film,
		       const struct incise_scene_picture *picture, uint32_t key)
{
	*drops = (struct drops){.film = film, .key = key};
	drops->viscosity = picture->viscosity_mPa_s * 1e-6;
}

/*
 * A new drop that hangs at a source; its index, or -1 when there are DROPS_MAX or there is no
 * surface. along_px: of the cut, of any length. units > 0.
 */
static int drops_new(struct drops *drops, const double px[2], const double along_px[2],
		     int source, int64_t units)
{
	struct ground ground;

	if (!ground_at(drops->film->map, drops->film->gravity, px, &ground))
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
			.clings =
				CLINGS_LEAST +
				(CLINGS_MOST - CLINGS_LEAST) *
					incise_random_uniform(drops->key, drops->drawn++),
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

/* Wetness at a place ahead, in mm along and across downhill; 0 … 1. */
static double wet_at(struct drops *drops, const struct drop *drop,
		     const struct ground *ground, double along, double across)
{
	double x =
		drop->px[0] + along * ground->down_px[0] + across * ground->across_px[0];
	double y =
		drop->px[1] + along * ground->down_px[1] + across * ground->across_px[1];

	return fmin(film_thickness_mm(drops->film, x, y) / WET_MM, 1);
}

/* Steer downhill, deflected by the skin's roughness and by wet skin. */
static void steer(struct drops *drops, struct drop *drop, const struct ground *ground,
		  double radius)
{
	double mm_x = drop->px[0] * ground->metric.a,
	       mm_y = drop->px[1] * ground->metric.c;
	double rough = noise_smooth(drops->key, (float)(mm_x / ROUGH_MM),
				    (float)(mm_y / ROUGH_MM)) +
		       0.3 * noise_smooth(drops->key + 1, (float)(mm_x / ROUGH_MM * 2.7),
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

/* The steepest slope under the drop, which hangs over on a surface that curves down. */
static double slope_of(struct drops *drops, const struct drop *drop,
		       const struct ground *ground, double radius)
{
	double px[2] = {drop->px[0] + radius * ground->down_px[0],
			drop->px[1] + radius * ground->down_px[1]};
	struct ground front;

	if (!ground_at(drops->film->map, drops->film->gravity, px, &front))
		return ground->slope;
	return fmax(ground->slope, front.slope);
}

static void accelerate(struct drops *drops, struct drop *drop,
		       const struct ground *ground, double radius)
{
	double ahead = wet_at(drops, drop, ground, 1.15 * radius, 0);
	double volume = (double)drop->units * BLOOD_UNIT_UL;
	double held = TENSION * HYSTERESIS * 2 * radius * (1 - (1 - WET) * ahead) *
		      drop->clings;
	double clot = 1 + drop->age_s * drop->age_s / (CLOT_S * CLOT_S);
	double drives, to;

	drop->wet += (ahead - drop->wet) * (STEP_S / RELAX_S);
	if (drop->speed_mm_s > 0)
		held *= MOVING;
	/* Clotting increases the hold of the edge more than the drag. */
	drives = WEIGHT * volume * slope_of(drops, drop, ground, radius) - held * clot;
	to = fmax(drives, 0) / (DRAG * drops->viscosity * clot * 2 * radius);
	to = fmin(to, SPEED_MAX_MM_S);
	drop->speed_mm_s += (to - drop->speed_mm_s) * (STEP_S / RELAX_S);
	if (drop->speed_mm_s < SPEED_LEAST_MM_S)
		drop->speed_mm_s = to > SPEED_LEAST_MM_S ? SPEED_LEAST_MM_S : 0;
}

/*
 * Leave film on the way, or take up thicker film: one spot per part of its radius, so that the cost
 * depends on the distance, not on the time.
 */
static void leave_film(struct drops *drops, struct drop *drop, double radius)
{
	double capillary = drops->viscosity * drop->speed_mm_s / TENSION;
	double thick = 0.94 * CAPILLARY_MM * cbrt(capillary * capillary);
	const struct ground_metric *m = &drop->metric;
	double width =
		FILM_WIDTH * radius *
		(1 + FILM_UNEVEN *
			     noise_smooth(drops->key + 2,
					  (float)(drop->px[0] * m->a / FILM_UNEVEN_MM),
					  (float)(drop->px[1] * m->c / FILM_UNEVEN_MM)));
	double share;

	if (drop->way_mm < FILM_EACH * width)
		return;
	share = 1 - exp(-drop->way_mm / (0.4 * width));
	drop->way_mm = 0;
	thick = fmin(fmax(FILM_THICKER * thick, FILM_LEAST_MM), FILM_MOST_MM) *
		(1 + (WET_THICKER - 1) * drop->wet);
	drop->units -=
		film_level(drops->film, drop->px, width, thick, share, drop->units);
}

static void run_blood(struct drops *drops, struct drop *drop, const struct ground *ground,
		      double radius)
{
	double way = drop->speed_mm_s * STEP_S;

	drop->way_mm += way;
	drop->ran_mm += way;
	leave_film(drops, drop, radius);
	for (int i = 0; i < 2; i++)
		drop->px[i] += way * (drop->heading[0] * ground->down_px[i] +
				      drop->heading[1] * ground->across_px[i]);
	if (drop->source >= 0)
		drop_turn_round(drop, ground);
	drop->source = -1;
}

/* Move part of a drop into the film below. */
static void sink(struct drops *drops, struct drop *drop, double radius, int64_t units)
{
	film_add(drops->film, drop->px, radius, units);
	drop->units -= units;
}

static void step_drop(struct drops *drops, struct drop *drop)
{
	struct ground ground;
	double radius = drop_radius_mm(drop->units);

	if (!ground_at(drops->film->map, drops->film->gravity, drop->px, &ground)) {
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
		run_blood(drops, drop, &ground, radius);
	} else if (drop->source < 0 && (drop->wet > 0.5 || drop->age_s > PINNED_S)) {
		sink(drops, drop, radius,
		     (int64_t)((double)drop->units *
			       (drop->wet > 0.5 ? WET_SINK : SINK)));
	}
	if (drop->source < 0 && drop->units < LEAST_UNITS)
		sink(drops, drop, radius, drop->units);
	if (drop->units && (drops->film->step + (uint64_t)(drop - drops->drop)) %
				   (drop->wet > 0.5 ? SHOWN_EACH_WET : SHOWN_EACH))
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
	/* The mixture's age is the mean of its parts'. */
	part = (double)units / (double)(units + to->units);
	to->age_s += (from->age_s - to->age_s) * part;
	to->units += units;
	from->units -= units;
	if (!from->units)
		vanish(drops, from);
}

/* Merge drops that touch, by their radii at the start of the step. */
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

static void drops_step(struct drops *drops)
{
	for (int i = 0; i < DROPS_MAX; i++)
		if (drops->drop[i].units)
			step_drop(drops, &drops->drop[i]);
	merge_all(drops);
}

/* --- Colour --- */

/*
 * Colour, by thickness and dryness. Light that passes through blood and back is absorbed by Beer
 * and Lambert: a film is translucent, a drop opaque. Alpha is 1 - exp(-h / h0), the colour goes
 * from light to dark red, and with drying to brown, first at thin edges.
 *
 * The height of a drop is added to the height of the film below it, and goes smoothly to zero:
 * there is no seam between a drop and its trail.
 */

/* At this thickness, mm, a film hides two thirds of the skin. */
#define HIDES_MM 0.013f
/* Thickness of half of the change from a thin film's colour to a thick one's. */
#define DARK_MM 0.16f
/* Thinner blood is invisible, mm. */
#define NOTHING_MM 0.0004f

/* Opacity by thickness, in steps up to where it is full. */
#define HIDE_STEPS 1024
#define HIDE_MOST_MM 0.064f
#define HIDE_FULL 0.985f

static void make_hides(float hides[HIDE_STEPS + 1])
{
	for (int i = 0; i <= HIDE_STEPS; i++)
		hides[i] =
			fminf(1 - expf(-HIDE_MOST_MM / HIDE_STEPS * (float)i / HIDES_MM),
			      HIDE_FULL);
}

/* --- Sources --- */

/* A source represents a stretch of a cut of random length between these, mm. */
#define SPAN_LEAST_MM 4.0
#define SPAN_MOST_MM 15.0
/* The wound is wetted first, to this thickness, by spots of this radius. */
#define WETS_MM 0.16
#define SPOT_MM 0.55
#define WETS_SHARE 0.5
/* A source emits every so many steps, each at its own time. */
#define EMIT_STEPS 8
/* An inserted instrument restores this part of the first flow, within this distance, mm. */
#define REOPENS 0.5
#define REOPENS_MM 9.0
#define REOPENS_DEPTH_MM 2.0
/* Below this, µl/s, a source has stopped. */
#define STOPPED_UL_S 1e-3

struct source {
	double from_px[2], to_px[2]; /* of its stretch */
	double at_px[2];	     /* of its drop */
	double length_mm, span_mm, at_mm;
	double first_ul_s; /* flow when fresh */
	double ul_s;	   /* now */
	double carry;	   /* of a unit */
	int drop;	   /* or -1 */
	double drop_mm;	   /* the drop's radius when it was last moved */
};

struct blood {
	struct film film;
	struct drops drops;
	double ul_s_mm2;
	uint64_t key, drawn; /* of random numbers, and their count */
	int64_t emitted;
	float hides[HIDE_STEPS + 1]; /* opacity by thickness */
	int n, last;		     /* sources; the growing one, or -1 */
	struct source source[BLOOD_SOURCES_MAX];
};

static double draw_blood(struct blood *blood)
{
	return incise_random_uniform(blood->key, blood->drawn++);
}

struct blood *blood_new(const struct uv_map *map,
			const struct incise_scene_picture *picture,
			struct incise_error *err)
{
	struct blood *blood = calloc(1, sizeof(*blood));

	if (!blood || !film_init(&blood->film, map, picture)) {
		blood_free(blood);
		return INCISE_ERROR_NULL(err, ENOMEM, "view: no memory for blood");
	}
	blood->key = incise_random_bits(0x626c6f6f64, (uint64_t)(int64_t)picture->seed);
	blood->ul_s_mm2 = picture->blood_ul_s_mm2;
	blood->last = -1;
	make_hides(blood->hides);
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

/* The place of a new source: a free place, or the source with the least flow. */
static int place_of_source(const struct blood *blood)
{
	int least = 0;

	if (blood->n < BLOOD_SOURCES_MAX)
		return blood->n;
	for (int i = 1; i < blood->n; i++)
		if (blood->source[i].ul_s < blood->source[least].ul_s)
			least = i;
	return least;
}

/* The drop that hangs at a source, or NULL. */
static struct drop *hanging(struct blood *blood, int number)
{
	int drop = blood->source[number].drop;

	return drop >= 0 && blood->drops.drop[drop].source == number
		       ? &blood->drops.drop[drop]
		       : NULL;
}

static struct source *start_source(struct blood *blood, const struct wound_stroke *stroke)
{
	int number = place_of_source(blood);
	struct source *source = &blood->source[number];

	if (number == blood->n)
		blood->n++;
	else if (hanging(blood, number))
		hanging(blood, number)->source = -1;
	*source = (struct source){
		.from_px = {stroke->from_px[0], stroke->from_px[1]},
		.at_px = {stroke->to_px[0], stroke->to_px[1]},
		.span_mm = SPAN_LEAST_MM +
			   (SPAN_MOST_MM - SPAN_LEAST_MM) * draw_blood(blood),
		.drop = -1,
	};
	source->at_mm = source->span_mm * draw_blood(blood);
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
		source = start_source(blood, stroke);
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

	if (!(in > 0) || !ground_metric(blood->film.map, px, &metric))
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

/* Some blood wets the cut; returns its amount. */
static int64_t wet(struct blood *blood, int number, int64_t units)
{
	const struct source *source = &blood->source[number];
	double t = draw_blood(blood), px[2];

	for (int i = 0; i < 2; i++)
		px[i] = source->from_px[i] + t * (source->to_px[i] - source->from_px[i]);
	return film_level(&blood->film, px, SPOT_MM * (0.7 + 0.6 * draw_blood(blood)),
			  WETS_MM, 0.3, (int64_t)((double)units * WETS_SHARE));
}

/* A drop hangs below its source, lower the larger it is. */
static void hang(struct blood *blood, struct source *source, struct drop *drop)
{
	double radius = drop_radius_mm(drop->units),
	       lower = 0.55 * (radius - source->drop_mm);
	struct ground ground;

	if (!(lower > 0) ||
	    !ground_at(blood->film.map, blood->film.gravity, drop->px, &ground))
		return;
	source->drop_mm = radius;
	for (int i = 0; i < 2; i++)
		drop->px[i] += lower * ground.down_px[i];
}

static void feed_blood(struct blood *blood, int number, int64_t units)
{
	struct source *source = &blood->source[number];
	struct drop *drop = hanging(blood, number);
	double along[2];

	if (drop && (double)drop->units * BLOOD_UNIT_UL > DROP_MOST_UL)
		drop->source = -1;
	else if (drop && drop->units) {
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
	/* It is more when the spot was too thick and got thinner. */
	if (left > 0)
		feed_blood(blood, number, left);
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
			/* A stopped source releases its drop. */
			if (hanging(blood, i))
				hanging(blood, i)->source = -1;
			source->drop = -1;
		}
	}
	drops_step(&blood->drops);
	film_step(&blood->film);
}

void blood_volumes(const struct blood *blood, struct blood_volumes *volumes)
{
	*volumes = (struct blood_volumes){
		.emitted = blood->emitted,
		.films = blood->film.units,
		.off = blood->film.off_units,
	};
	for (int i = 0; i < DROPS_MAX; i++) {
		volumes->drops += blood->drops.drop[i].units;
		volumes->n_drops += blood->drops.drop[i].units > 0;
	}
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

/* A drop's height at (dx, dy) texels from its middle; @rough: of its edge there, -1 … 1. */
static float height(const struct shape *shape, float dx, float dy, float rough)
{
	float u = shape->metric.a * dx + shape->metric.b * dy, v = shape->metric.c * dy;
	float along = u * shape->axis[0] + v * shape->axis[1];
	float across = (v * shape->axis[0] - u * shape->axis[1]) * shape->beside;
	float r2, cap;

	along *= along > 0 ? shape->before : shape->behind;
	r2 = (along * along + across * across) * (1 + FILM_ROUGH * rough);
	if (r2 >= 1)
		return 0;
	cap = 1 - r2;
	return shape->high_mm * cap * sqrtf(cap);
}

/* The texels of a row that a drop can touch; @dy: from its middle. */
static void clip_shape(const struct shape *shape, float dy, int *left, int *right)
{
	const struct ground_metric *m = &shape->metric;
	float u = m->b * dy - m->a * (shape->x - 0.5f), v = m->c * dy;

	canvas_clip_row(u * shape->axis[0] + v * shape->axis[1], m->a * shape->axis[0],
			-(float)ROUGHEST / shape->behind, (float)ROUGHEST / shape->before,
			left, right);
	canvas_clip_row(v * shape->axis[0] - u * shape->axis[1], -m->a * shape->axis[1],
			-(float)ROUGHEST / shape->beside, (float)ROUGHEST / shape->beside,
			left, right);
}

static void add_shape(float *tile, int x0, int y0, const struct shape *shape)
{
	int left = shape->from_px[0] > x0 ? shape->from_px[0] : x0;
	int right =
		shape->to_px[0] < x0 + CANVAS_TILE ? shape->to_px[0] : x0 + CANVAS_TILE;
	int top = shape->from_px[1] > y0 ? shape->from_px[1] : y0;
	int bottom =
		shape->to_px[1] < y0 + CANVAS_TILE ? shape->to_px[1] : y0 + CANVAS_TILE;
	float rough[CANVAS_TILE];

	for (int y = top; y < bottom; y++) {
		float *row = tile + (y - y0) * CANVAS_TILE - x0;
		int from = left, to = right;

		clip_shape(shape, (float)y + 0.5f - shape->y, &from, &to);
		if (from >= to)
			continue;
		noise_smooth_row(FILM_ROUGH_KEY, shape->grain, from,
				 (float)y * shape->grain, to - from, rough);
		for (int x = from; x < to; x++)
			row[x] += height(shape, (float)x + 0.5f - shape->x,
					 (float)y + 0.5f - shape->y, rough[x - from]);
	}
}

static float hides(const float table[HIDE_STEPS + 1], float thick)
{
	float at = thick * (HIDE_STEPS / HIDE_MOST_MM) + 0.5f;

	return thick > NOTHING_MM ? table[at < HIDE_STEPS ? (int)at : HIDE_STEPS] : 0;
}

/* A colour's channel, times 255: of a thin film, change to a thick one, and to a dry one's. */
struct channel {
	float thin, thicker, brown;
};

/* A row of a tile, in a form that compilers vectorize. */
static void colour_row(const float thick[CANVAS_TILE], const float alpha[CANVAS_TILE],
		       const uint8_t dry[CANVAS_TILE], uint32_t rgba[CANVAS_TILE])
{
	static const struct channel channels[3] = {
		{143, -51, 69}, {4, -3, 14}, {5, -3.5f, 9}};
	float dark[CANVAS_TILE], dried[CANVAS_TILE];

	for (int i = 0; i < CANVAS_TILE; i++) {
		dark[i] = thick[i] / (thick[i] + DARK_MM);
		dried[i] = (float)dry[i] * (0.75f / FILM_DRY);
		rgba[i] = (uint32_t)(int)(alpha[i] * 255 + 0.5f) << 24;
	}
	for (int c = 0; c < 3; c++) {
		const struct channel *k = &channels[c];

		for (int i = 0; i < CANVAS_TILE; i++) {
			float v = k->thin + dark[i] * k->thicker;

			v += dried[i] * (k->brown - v);
			rgba[i] |= (uint32_t)(int)(v * alpha[i] + 0.5f) << 8 * c;
		}
	}
}

/* Thickness of film and drops on a tile, mm; false: there is nothing. */
static bool fill_tile(const struct film *film, float unit, const struct shape *shapes,
		      int n, int x0, int y0, float tile[FILM_TEXELS])
{
	const uint32_t *volume = film->volume + film_index(film, x0, y0);
	uint32_t any = 0;

	for (int i = 0; i < FILM_TEXELS; i++) {
		any |= volume[i];
		tile[i] = (float)volume[i] * unit;
	}
	for (int i = 0; i < n; i++) {
		const struct shape *shape = &shapes[i];

		if (shape->to_px[0] <= x0 || shape->from_px[0] >= x0 + CANVAS_TILE ||
		    shape->to_px[1] <= y0 || shape->from_px[1] >= y0 + CANVAS_TILE)
			continue;
		any = 1;
		add_shape(tile, x0, y0, shape);
	}
	return any;
}

/*
 * Opacity of a tile's texels, each with a share of its neighbours' in the tile: soft edges. At the
 * border of a tile an edge is sharper, which one texel does not show.
 */
static void soften(const float table[HIDE_STEPS + 1], const float tile[FILM_TEXELS],
		   float alpha[FILM_TEXELS])
{
	enum { SIDE = CANVAS_TILE, LAST = CANVAS_TILE - 1 };
	float row[FILM_TEXELS], hard[SIDE + 2];

	for (int j = 0; j < SIDE; j++) {
		for (int i = 0; i < SIDE; i++)
			hard[i + 1] = hides(table, tile[j * SIDE + i]);
		hard[0] = hard[1];
		hard[SIDE + 1] = hard[SIDE];
		for (int i = 0; i < SIDE; i++)
			row[j * SIDE + i] =
				0.25f * (hard[i] + 2 * hard[i + 1] + hard[i + 2]);
	}
	for (int j = 0; j < SIDE; j++) {
		const float *at = row + j * SIDE, *above = at - (j > 0 ? SIDE : 0),
			    *below = at + (j < LAST ? SIDE : 0);

		for (int i = 0; i < SIDE; i++)
			alpha[j * SIDE + i] = 0.25f * (above[i] + 2 * at[i] + below[i]);
	}
}

/* Returns whether a texel changed. */
static bool paint_tile(struct film *film, const float table[HIDE_STEPS + 1],
		       const struct shape *shapes, int n, int number, uint8_t *rgba)
{
	int x0 = number % film->tiles.side * CANVAS_TILE,
	    y0 = number / film->tiles.side * CANVAS_TILE;
	const uint8_t *dry = film->dry + (size_t)number * FILM_TEXELS;
	float unit = (float)(BLOOD_UNIT_UL / film_tile(film, x0, y0)->area_mm2);
	float thick[FILM_TEXELS], alpha[FILM_TEXELS];
	bool changed = false, any = fill_tile(film, unit, shapes, n, x0, y0, thick);

	if (any)
		soften(table, thick, alpha);
	for (int y = 0; y < CANVAS_TILE; y++) {
		uint8_t *to = rgba + ((size_t)(y0 + y) * film->size + x0) * 4;
		uint32_t is[CANVAS_TILE] = {0};
		int at = y * CANVAS_TILE;

		if (any)
			colour_row(thick + at, alpha + at, dry + at, is);
		if (!memcmp(to, is, sizeof(is)))
			continue;
		memcpy(to, is, sizeof(is));
		changed = true;
	}
	return changed;
}

void blood_paint(struct blood *blood, struct incise_canvas *canvas, int layer)
{
	struct film *film = &blood->film;
	uint8_t *rgba = incise_canvas_layer(canvas, layer);
	struct shape shapes[DROPS_MAX];
	int n = 0;

	if (!film->tiles.n_dirty || !rgba)
		return;
	for (int i = 0; i < DROPS_MAX; i++)
		n += blood->drops.drop[i].units &&
		     drop_shape(film, &blood->drops.drop[i], &shapes[n]);
	for (int i = 0; (i = canvas_tiles_next(&film->tiles, i)) >= 0;)
		/* Drying and draining mostly change a colour by less than a step. */
		if (paint_tile(film, blood->hides, shapes, n, i, rgba))
			incise_canvas_dirty(canvas, canvas_tile_rect(&film->tiles, i));
}
