/* SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only */
/*
 * The numbers, state and stages of a tick for a kind of numbers: included between ../number/NAME_kind.h
 * and no_kind.h, by ../fixed/plan.h for the integers of programs and the kernel, by tick.h for double.
 * The .proto.c beside this are the physics, once; they are compiled for each kind.
 *
 *   pose ─▶ predict ─▶ tool ─▶ contact ─▶ normal ─▶ incision ─▶ membrane ─▶ texture ─▶ forces ─▶ start ─▶ work ─▶ limit
 *
 * A stage that its plan does not need does nothing, and may be left out. Lengths mm, forces N, springs
 * N/mm, speeds mm/s; times ns of CLOCK_MONOTONIC. All functions of a tick are real-time safe, and take
 * a bounded time.
 */

/* --- predict.proto.c ---------------------------------------------------------------------- */

/* The filter of one tracker; see ../control/predict.h. */
struct T(filter) {
	dir alpha;	 /* of a miss, to x; 0 … 1 */
	num beta;	 /* 1/s, to v; 0 … */
	num12 gamma;	 /* 1/s², to a; 0 … */
	span period_ns;	 /* from pose to pose */
	span latency_ns; /* 0 … 10^9 */
	span gap_ns;	 /* after a longer one it restarts */
	span ahead_ns;	 /* it goes no further */
	int32_t reserved;
};

/* Where a point is, by its poses. Begins with T(predict_init)(). */
struct T(predict) {
	int64_t t_ns;	       /* of acquisition of the last pose */
	int64_t arrival_ns;    /* of it */
	wide x[3], v[3], a[3]; /* at t_ns; Q32 mm, Q20 mm/s, Q16 mm/s² */
	/* The shown value when a pose arrived, less the filter's then. */
	wide x_shown[3]; /* Q24 mm */
	wide v_shown[3];
	wide a_shown[3];
	dir q[4], q_shown[4];
	uint32_t
		discontinuities; /* poses that no hand can have reached since the last one */
	int32_t started;
};

/* Start without a pose. */
void T(predict_init)(struct T(predict) *p);

/*
 * Take a pose in. Any numbers are safe. A pose beyond 10 m, or not newer than the last, is passed over; an invalid
 * quaternion leaves the attitude as it was. Returns whether it was taken.
 *
 * After a gap of more than gap_ns velocity starts from 0. The filter also starts again when a pose is more than 20
 * mm from its expected place: no hand did that, and the tool must not be dragged through the tissue, so there is
 * no blend, either; the force's limits do the rest.
 */
bool T(predict_add)(struct T(predict) *p, const struct T(filter) *filter,
		    const num position[3], const dir quaternion[4],
		    int64_t t_ns) INCISE_REALTIME;

/*
 * Position and velocity at a time. Before the first pose all is 0. Velocity is the filter's, held to
 * ±10^4 mm/s, and not the derivative of the position, which holds the speed of the correction too.
 */
void T(predict_at)(const struct T(predict) *p, const struct T(filter) *filter,
		   int64_t t_ns, num position[3], num velocity[3]) INCISE_REALTIME;

/* The acceleration then, Q16 mm/s², within ±10^5. */
void T(predict_acceleration)(const struct T(predict) *p, const struct T(filter) *filter,
			     int64_t t_ns, wide acceleration[3]) INCISE_REALTIME;

/* The attitude then, a unit quaternion, not extrapolated. Costs a root: only when asked. */
void T(predict_attitude)(const struct T(predict) *p, const struct T(filter) *filter,
			 int64_t t_ns, dir attitude[4]) INCISE_REALTIME;

/* Age of the last pose, ≥ 0; INT64_MAX before the first. */
int64_t T(predict_age)(const struct T(predict) *p, int64_t t_ns) INCISE_REALTIME;

/* --- front.proto.c ------------------------------------------------------------------------ */

/*
 * A straight line in the surface: where the blade began, its direction there, and how far it went.
 *
 *              side = Sx(0)
 *                 ▲
 *       from  ────┼───────────▶ to    along = side × normal
 *                 at
 */
struct T(line) {
	int32_t there;
	num at[3];
	dir side[3];  /* the blade's side axis when the cut began */
	dir along[3]; /* unit, in the surface */
	num from, to;
};

/* The direction of a blade in a surface; any there when it lies flat. side and normal are unit. */
void T(line_along)(dir along[3], const dir normal[3], const dir side[3]) INCISE_REALTIME;

#define T_FRONT_CUTS 8

/* The way of a front through new tissue; see T(front_way)(). */
struct T(way) {
	wide most;	 /* Q16 mm, ≥ 0 */
	wide before;	 /* on the lines of the cut before this one; Q16 mm */
	uint32_t number; /* of the cut, from 0 on */
};

/* The front of a cut; see front.proto.c. Begins with {0}. It remembers this many cuts, with the one in which it is. */
struct T(front) {
	num depth, force; /* of the last call */
	num rest;	  /* the elastic force is 0 here */
	num cut;	  /* depth of the unloaded cut; ≥ 0 */
	wide work2,
		most2; /* twice the work put in, less the work that came back; the most so far */
	struct T(line) line;
	struct {
		struct T(line) line;
		num cut;
		struct T(way) way;
	} kept[T_FRONT_CUTS]; /* as they were left; that in which it is, as it was entered */
	int32_t n, in, newest; /* so many there are; it is in this one; this began last */
	struct T(way) way;
	num off[3];	/* from the line to the place of the last advance */
	uint32_t begun; /* cuts, so far */
	int32_t rises, /* for the caller to set, before a call: the cutting force rises by its texture … */
		climbs; /* … and the front's follows it, which was near it at the last call */
};

/*
 * The blade meets the skin at a place of it: in the nearest of the cuts that it left and that hold it, or in a new
 * one, for which the cut that began first is forgotten.
 * Returns whether the cut is new.
 */
bool T(front_enter)(struct T(front) *front, const num at[3], const dir normal[3],
		    const dir side[3]) INCISE_REALTIME;

/* Length of new tissue since the last call: the way of the blade beyond its own cut. */
num T(front_advance)(struct T(front) *front, const num at[3], const dir normal[3],
		     const dir side[3]) INCISE_REALTIME;

/*
 * Move the way of the front through new tissue on: of all places where the blade was, it is the largest sum of the
 * length of its cut, until then, and its depth. So it depends on places alone, and not on how often they are looked
 * at; it stays while the blade rests, draws back or is where it was. Call after T(front_advance)(). Returns whether it
 * went on.
 */
bool T(front_way)(struct T(front) *front, num depth) INCISE_REALTIME;

/*
 * The force on the blade, out of the tissue: -friction × cutting … cutting. Any numbers are safe.
 *
 * @param unloading  K > 0
 * @param friction   0 … 1, share of the cutting force
 * @param depth      ≥ 0
 * @param advance    of T(front_advance)(), ≥ 0
 * @param cutting    the model's force at this depth and speed, ≥ 0
 */
num T(front_force)(struct T(front) *front, num unloading, num friction, num depth,
		   num advance, num cutting) INCISE_REALTIME;

/* Lines along which a blade tore tissue, and how deep each place is torn; see tear.proto.c. Begins with {0}. */
struct T(tears) {
	num tip;     /* the tissue holds the edge here on its line … */
	num torn[2]; /* … and is torn so far in that place, backwards and on … */
	num depth;   /* … and so deep */
	int32_t n, in, newest;
	struct T(tear) {
		struct T(line) line;
		stored depth[INCISE_FIXED_CUT_PLACES];
	} kept[T_FRONT_CUTS];
};

/* --- incision.proto.c --------------------------------------------------------------------- */

/* Numbers of a scene; lengths 0 … 1000. */
struct T(incision_setup) {
	int32_t cuts_most; /* 0: the blade leaves no cut */
	num cut_from;	   /* the blade cuts where it is deeper */
	num stretch;	   /* elastic part of an opening */
	num handle_width, handle_thickness;
	num tube;
};

/* The cuts of a blade, for ticks. Begins with {0}. */
struct T(incision) {
	int32_t cutting,
		growing;  /* the blade is in this cut; the kernel has a macro current */
	num at[3], depth; /* of the last tick */
	num checked[3];	  /* up to here, for other cuts that it meets */
	num behind[3];	  /* the place before that: a way that is no noise */
	struct T(opening) met; /* of handle or tube at this tick */
	num open;	       /* depth of the cut in which the blade is, as it was … */
	struct T(cut) was;     /* … when the blade came into it in this contact */
	int32_t entered;       /* it did */
	int32_t n;
	struct T(cut) cut[CUTS];
};

/* The blade at this tick. Returns false where it would cut but leaves no cut: cuts_most are there. */
bool T(incision_cut)(struct T(incision) *incision, const struct T(incision_setup) *setup,
		     const num proxy[3], const dir normal[3], const dir side[3],
		     num depth) INCISE_REALTIME;

/* Handle or tube at this tick: it opens the cut that it is in, met. @flat: its side, unit. */
void T(incision_open)(struct T(incision) *incision, const struct T(incision_setup) *setup,
		      enum incise_tool tool, const num proxy[3], const dir flat[3],
		      num depth) INCISE_REALTIME;

/* Neither is in the tissue. */
void T(incision_leave)(struct T(incision) *incision) INCISE_REALTIME;

/* The opening for a tool at a place of the surface. */
void T(incision_find)(const struct T(incision) *incision,
		      const struct T(incision_setup) *setup, enum incise_tool tool,
		      const num at[3], struct T(opening) *opening) INCISE_REALTIME;

/*
 * The share of a handle's width or a tube's diameter that an opening must still give, 0 … 1: for a handle 1 where
 * no tool has widened the cut, for a tube less, as the tissue stretches; 0 where it is as wide as the tool less
 * the stretch of the tissue.
 */
num T(incision_tightness)(const struct T(incision_setup) *setup,
			  const struct T(opening) *opening,
			  enum incise_tool tool) INCISE_REALTIME;

/* --- tick.proto.c ------------------------------------------------------------------------- */

/* A membrane over an airway; thickness 0: no membrane. */
struct T(membrane) {
	num point[3];
	dir normal[3];
	num radius;
	num thickness; /* it yields after so much */
	num stiffness; /* until then */
	num back_wall;
};

/* An actuator: its nut goes where the spring pushes with the wanted force. */
struct T(axis) {
	dir direction[3];
	num24 dual[3];	  /* the force along it is dual · force */
	num20 compliance; /* mm/N, above 0 */
	num steps_per_mm; /* above 0 */
	num origin;	  /* along the direction, where the nut is at 0 */
	num travel;	  /* 0 … */
	num rest;	  /* 0 … travel: where the nut goes without a force */
	int32_t reserved;
};

#define T_AXES_MAX 3
#define T_AVERAGE_MAX 64

/* Bits of phases. */
#define T_PUNCTURES 1
#define T_WITHDRAWS 2

/*
 * The numbers of a plan, in a .plan file and in memory. In a file all are checked by
 * incise_fixed_plan_open().
 */
struct T(numbers) {
	int64_t bound; /* certified error of the force against the plan in double, 2^-32 N */
	int64_t pose_age_ns; /* without a younger pose the force fades */
	int32_t tick_ns;
	int32_t n_axes;
	struct T(filter) filter;

	/* The scalpel, in the frame of the tracker's poses. */
	num tip[3];	 /* of the blade */
	dir axis[3];	 /* from the tip to the handle's end */
	dir side[3];	 /* normal of the flat side of blade and handle */
	num handle;	 /* the handle's end, from the tip */
	int32_t inserts; /* handle and tube can be held */
	int32_t tube;	 /* the tube has a station of the tracker */

	T_OWN_SURFACE
	dir up[3];	       /* normal of the surface's top */
	num leave;	       /* a contact ends so far outside */
	int32_t average_ticks; /* of the normal, 1 … T_AVERAGE_MAX */

	/* The reaction: a spring, or a model, and with `unloading` the front of a cut. */
	num reaction;
	num gain;	     /* of the model's force */
	num support, beyond; /* its largest depth, and its slope beyond */
	num unloading, friction;
	num plane;
	num28 damping; /* N s/mm */
	num insertion, aligned;
	int32_t printed;
	num spread;
	struct T(incision_setup) incision;
	struct T(membrane) membrane;

	num small;	 /* no force before one as small as this is asked for */
	period ramp_ns;	 /* a force comes in this time … */
	period fade_ns;	 /* … and goes in this */
	num force, slew; /* largest one, and largest change of it in a tick */
	struct T(axis) axes[T_AXES_MAX];
	/*
	 * The model's inputs, from the lowest bits on: four bits each, one more than enum
	 * incise_model_input, once each. 0: depth, or depth and speed.
	 */
	int32_t inputs;
	int32_t phases; /* models besides the model of the cut: T_PUNCTURES, T_WITHDRAWS */
	num account; /* all springs together, in a plan whose work is on account; else 0 */
	num upright; /* the membrane leans from the skin by no more: a cosine */
#define FORCE(...)
#define NUMBER(...)
#define MORE(member) num member;
#include "forces.def"
#undef MORE
#define MORE(member) -1
	int32_t reserved[5
#include "forces.def"
	];
#undef MORE
#undef NUMBER
#undef FORCE
};

/* A pose of the tracker. */
struct T(pose) {
	int64_t t_ns; /* when it came */
	num position[3];
	dir quaternion[4];
	uint32_t tool; /* INCISE_FIXED_POSE_… */
};

/* The height of an end above the surface, when that was last searched for it. */
struct T(above) {
	num above;
	num end[3];
	int32_t known;
};

enum { T(TIP), T(HANDLE), T(TUBE), T(ENDS) };

/* With stage tool: the other ends than the blade's tip. */
struct T(ends) {
	struct T(predict) handle, tube;
	struct T(above) above[T(ENDS)]; /* with a tube's station */
};

/* With stage normal. */
struct T(average) {
	int32_t n, at;
	dir ring[T_AVERAGE_MAX][3];
	wide sum[3], turn[3]; /* turn: of those since at was 0 */
	dir last[3];
};

/* Twice the work put in until the last tick, less the work that came back; the force then, and before. */
struct T(fund) {
	wide work2;
	num last[3], before[3];
};

/* With stage work. */
struct T(account) {
	struct T(fund) all, late;
	num at[3], way[3]; /* of the last tick, and to it */
	int32_t held;
};

/* The state of a plan between ticks. Set by T(plan_begin)(). */
struct T(state) {
	struct T(predict) scalpel;
	int64_t last_ns; /* of the last tick; 0: none */
	wide gain;	 /* of start, Q30 */
	int32_t released, fading, changing;
	int32_t wanted, held, tube_nearer;
	struct T(proxy) proxy;
	dir attitude[4];
	num velocity[3];    /* of the end of what is held */
	num p0[3];	    /* where the contact began */
	dir entry[3];	    /* the normal there */
	dir sn[3];	    /* the paper's Sn of this tick */
	dir normal[3];	    /* direction of forces: Sn, or its average */
	num depth;	    /* ≥ 0; of the tissue in front of a membrane */
	int64_t touched_ns; /* when the contact began */
	num deepest;	    /* of the blade since then … */
	wide path;	    /* … and its path, until … */
	int64_t path_ns;
	int32_t skin_open; /* it came into a cut that was there */
	num fresh;	   /* with stage texture: new tissue of this tick … */
	num factor, tooth; /* … factor of the cut and 1 + τ … */
	int32_t goes_on;   /* … and whether the front met new tissue */
	num open;	   /* so deep a spring meets friction only */
	dir side[3];	   /* of the blade when its contact began: Sx(0) */
	dir flat[3];	   /* of blade and handle now */
	int32_t averaged;  /* the average has begun in this contact */
	struct T(front) front;
	struct T(opening) opening; /* that handle or tube went into … */
	num tightness;		   /* … and how tight it was */
	struct {
		int32_t met; /* the tool is beyond the plane of the membrane … */
		int32_t hit; /* … and came there through it */
		int32_t punctured;
	} membrane;
	wide anchor[3]; /* of the skin that drags; Q32 mm */
	struct T(tears) tears;
	struct T(account) account;
	num force[3];	       /* of the tissue, before limits … */
	num late[3];	       /* … and its late part */
	num last[3];	       /* rendered last */
	num place[T_AXES_MAX]; /* of the handle along each axis, from its origin */
	struct T(ends) OWNED ends;
	struct T(average) OWNED average;
	struct T(incision) OWNED incision;
};

/* The result of a tick. Without contact proxy and normal are 0. */
struct T(tick) {
	int64_t t_ns;
	int64_t age_ns; /* of the pose; INT64_MAX: there was none */
	num position[3];
	dir attitude[4];
	num tool[3], proxy[3];
	dir normal[3];
	num depth, speed;
	num command[3];
	num along[T_AXES_MAX];	    /* force of each actuator */
	int32_t target[T_AXES_MAX]; /* of its nut, steps */
	num textured;	     /* N of the cut due to τ, where the front met new tissue */
	uint32_t flags;	     /* INCISE_TICK_… */
	int32_t phase, held; /* enum incise_phase, enum incise_tool */
};

struct T(plan);

/* --- of each kind of plan besides: its surface, its model and its texture --- */

/* Follow the tool: touching, began; with those the touch, and the first one. */
void T(surface_move)(const struct T(plan) *plan, struct T(proxy) *proxy,
		     const num tool[3]) INCISE_REALTIME;

/* Height of a place above the surface. */
num T(surface_above)(const struct T(plan) *plan, const num place[3]) INCISE_REALTIME;

/* The next place is the tool's first. */
void T(surface_restart)(const struct T(plan) *plan) INCISE_REALTIME;

/* The inputs of a phase's model (enum incise_cutting_phase), as numbers.inputs has them. */
uint32_t T(model_inputs)(const struct T(plan) *plan, int32_t phase) INCISE_REALTIME;

/* Its force, N; sets @outside where an input is beyond its range. */
num T(model_force)(const struct T(plan) *plan, int32_t phase, const num *x,
		   bool *outside) INCISE_REALTIME;

/* 1 + τ of the plan's texture, at a way of a cut, and the factor of that cut. */
num T(texture_at)(const struct T(plan) *plan, const struct T(way) *way,
		  num *factor) INCISE_REALTIME;

/*
 * Inputs: the rate of change of the speed |v|, mm/s², which below 5 mm/s goes to 0 with the speed, for a
 * blade at rest has no direction of motion: no more than |a|, and without a leap; the angle of two unit
 * vectors, degrees; a time, s; a path, to which a tick adds its speed over the time since the last, and that path over
 * the time since @from_ns, mm/s, the speed where there is no such time.
 */
num T(input_acceleration)(const num velocity[3],
			  const wide acceleration[3]) INCISE_REALTIME;
num T(input_tilt)(const dir axis[3], const dir normal[3]) INCISE_REALTIME;
num T(input_time)(int64_t t_ns, int64_t from_ns) INCISE_REALTIME;
wide T(input_path)(wide path, num speed, int64_t from_ns, int64_t t_ns) INCISE_REALTIME;
num T(input_mean_speed)(wide path, num speed, int64_t from_ns,
			int64_t t_ns) INCISE_REALTIME;

/* --- ticks --- */

/* Start without a pose, a contact or a cut. */
void T(plan_begin)(const struct T(plan) *plan, struct T(state) *state);

/*
 * Take a pose in, before the tick; a pose from the future counts as of now. Any numbers are safe.
 */
enum incise_fixed_pose_answer T(plan_pose)(const struct T(plan) *plan,
					   struct T(state) *state,
					   const struct T(pose) *pose,
					   int64_t now_ns) INCISE_REALTIME;

/* The stages of a tick, in their order. */
typedef void T(stage_fn)(const struct T(plan) *plan, struct T(state) *state,
			 struct T(tick) *tick) INCISE_REALTIME;
T(stage_fn) T(stage_predict);
T(stage_fn) T(stage_tool);
T(stage_fn) T(stage_contact);
T(stage_fn) T(stage_normal);
T(stage_fn) T(stage_incision);
T(stage_fn) T(stage_membrane);
T(stage_fn) T(stage_texture);
#define FORCE(row, name, ...) T(stage_fn) T(stage_##name);
#define NUMBER(...)
#define MORE(member)
#include "forces.def"
#undef MORE
#undef NUMBER
#undef FORCE
T(stage_fn) T(stage_start);
T(stage_fn) T(stage_work);
T(stage_fn) T(stage_limit);
