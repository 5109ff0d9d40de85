// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Ticks to a session; see session.h. Memory does not grow with time: a list that is full is made
 * coarser, and the session says by how much.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <incise/clock.h>
#include <incise/incision.h>
#include <incise/version.h>
#include "../../lib/base/ascending.h"
#include "../../lib/base/vector.h"
#include "session.h"

#define TRACE_S 0.02	 /* 50 Hz */
#define AIR_LONGER 10	 /* than in the tissue; nothing happens there */
#define APART_S 0.05	 /* a contact that chatters is one */
#define APART_MOST_S 1e4 /* hours between two contacts are no gap to close */
#define PLACED_MM 0.5	 /* more than the noise of a tracker's pose moves a tube */
#define TURN_DEG 30.0	 /* a smaller one is a hand that trembles */

struct session_digest {
	struct incise_incision *incision;
	struct incise_scene_scalpel scalpel;
	struct session session;

	int64_t first_ns, last_ns; /* ticks */
	bool started, in_tissue;
	/* The handle in its cut: the angle now, the way that it turns, and the ends since. */
	bool turning;
	double line[3]; /* of the cut that it went into */
	int way;	/* 1, -1; 0: not yet */
	double angle_deg, low_deg, high_deg;
	bool met, hit; /* beyond the plane of the membrane, and through it */
	bool at_wall;
	double placed_mm; /* depth of the tube at session.insertion.placed_s */
};

bool session_is_code(const char *text)
{
	size_t n = strspn(text, "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ"
				"0123456789-_");

	/* At its start '-' would be an option, and a formula of a spreadsheet. */
	return n > 0 && n <= SESSION_CODE_MAX && !text[n] && *text != '-';
}

struct session_digest *session_digest_new(const struct incise_scene *scene,
					  struct incise_error *err)
{
	struct session_digest *digest = calloc(1, sizeof(*digest));
	struct session *s;

	if (!digest)
		return INCISE_ERROR_NULL(err, ENOMEM, "no memory for a session");
	digest->incision = incise_incision_new(scene, err);
	if (!digest->incision) {
		free(digest);
		errno = ENOMEM;
		return NULL;
	}
	s = &digest->session;
	incise_scene_scalpel(scene, &digest->scalpel);
	incise_scene_criteria(scene, s->criteria);
	s->has_membrane = incise_scene_membrane(scene, &s->membrane);
	s->scene.rate_hz = incise_scene_rate_hz(scene);
	s->trace_s = TRACE_S;
	s->phases_apart_s = APART_S;
	s->start_unix_s = s->first_s = s->last_s = s->needed_s = NAN;
	s->insertion.placed_s = s->target.t_s = s->target.off_axis_mm = NAN;
	s->target.missed_mm = s->force.t_s = NAN;
	strcpy(s->version, INCISE_VERSION);
	strcpy(s->end.kind, "asked");
	return digest;
}

void session_digest_free(struct session_digest *digest)
{
	if (!digest)
		return;
	incise_incision_free(digest->incision);
	free(digest);
}

/* --- phases ---------------------------------------------------------------------------- */

static bool goes_on(const struct session *s, const struct session_phase *phase,
		    enum incise_tool tool, double from_s)
{
	return phase->tool == tool && from_s - phase->to_s <= s->phases_apart_s;
}

/* Close gaps that are short enough now. */
static void close_gaps(struct session *s)
{
	int n = 0;

	for (int i = 0; i < s->n_phases; i++) {
		const struct session_phase *phase = &s->phase[i];
		struct session_phase *last = n ? &s->phase[n - 1] : NULL;

		if (last && goes_on(s, last, phase->tool, phase->from_s)) {
			last->to_s = phase->to_s;
			last->depth_mm = fmax(last->depth_mm, phase->depth_mm);
			last->force_N = fmax(last->force_N, phase->force_N);
		} else {
			s->phase[n++] = *phase;
		}
	}
	s->n_phases = n;
}

/* Close longer gaps until there are fewer phases; false: no gap between one tool's phases. */
static bool make_place(struct session *s)
{
	double apart_s = s->phases_apart_s;

	while (s->n_phases == SESSION_PHASES_MAX && s->phases_apart_s < APART_MOST_S) {
		s->phases_apart_s *= 2;
		close_gaps(s);
	}
	if (s->n_phases < SESSION_PHASES_MAX)
		return true;
	s->phases_apart_s = apart_s;
	return false;
}

/* The last phase, if this contact belongs to it; else NULL. */
static struct session_phase *last_phase(struct session *s, enum incise_tool tool,
					double t_s)
{
	struct session_phase *last = s->n_phases ? &s->phase[s->n_phases - 1] : NULL;

	return last && goes_on(s, last, tool, t_s) ? last : NULL;
}

/* The phase that this contact belongs to; NULL: it is left out. */
static struct session_phase *phase_at(struct session_digest *digest,
				      enum incise_tool tool, double t_s)
{
	struct session *s = &digest->session;
	struct session_phase *phase = last_phase(s, tool, t_s);

	if (!phase && s->n_phases == SESSION_PHASES_MAX) {
		if (!make_place(s)) {
			s->phases_left_out += !digest->in_tissue;
			return NULL;
		}
		phase = last_phase(s, tool, t_s);
	}
	if (phase)
		return phase;
	phase = &s->phase[s->n_phases++];
	*phase = (struct session_phase){.tool = tool, .from_s = t_s};
	return phase;
}

static void add_phase(struct session_digest *digest, const struct incise_tick *tick,
		      double t_s, double force_N)
{
	struct session *s = &digest->session;
	bool in_tissue = tick->phase != INCISE_PHASE_FREE;
	struct session_phase *phase;

	if (in_tissue) {
		phase = phase_at(digest, tick->tool, t_s);
		if (phase) {
			phase->to_s = t_s;
			phase->depth_mm = fmax(phase->depth_mm, tick->depth_mm);
			phase->force_N = fmax(phase->force_N, force_N);
		}
		if (isnan(s->first_s))
			s->first_s = t_s;
		s->last_s = t_s;
	}
	digest->in_tissue = in_tissue;
}

/* --- handle, tube, membrane ------------------------------------------------------------ */

/* A turn is a swing one way, however far; it ends where the handle comes back by TURN_DEG. */
static void add_angle(struct session_digest *digest, double deg)
{
	struct session *s = &digest->session;

	s->enlarging.turned_deg = fmax(s->enlarging.turned_deg, fabs(deg));
	if (!digest->turning) {
		digest->low_deg = digest->high_deg = digest->angle_deg = deg;
		digest->way = 0;
	}
	digest->turning = true;
	/* A flat side looks the same from behind. */
	digest->angle_deg = deg + 180 * round((digest->angle_deg - deg) / 180);
	digest->low_deg = fmin(digest->low_deg, digest->angle_deg);
	digest->high_deg = fmax(digest->high_deg, digest->angle_deg);
	if (digest->way <= 0 && digest->angle_deg >= digest->low_deg + TURN_DEG) {
		s->enlarging.turns++;
		digest->way = 1;
		digest->high_deg = digest->angle_deg;
	} else if (digest->way >= 0 && digest->angle_deg <= digest->high_deg - TURN_DEG) {
		s->enlarging.turns++;
		digest->way = -1;
		digest->low_deg = digest->angle_deg;
	}
}

/* Angle of the handle's flat side out of the line of its cut, -90 … 90. */
static void see_handle(struct session_digest *digest, const struct incise_tick *tick,
		       double force_N)
{
	struct session *s = &digest->session;
	struct incise_opening opening;
	double flat[3], across[3], along_part, across_part;

	s->enlarging.force_N = fmax(s->enlarging.force_N, force_N);
	incise_incision_opening(digest->incision, INCISE_TOOL_HANDLE, tick->proxy_mm,
				&opening);
	if (!opening.in) {
		digest->turning = false;
		return;
	}
	s->enlarging.time_s += 1 / s->scene.rate_hz;
	/* Where cuts cross, it may be in either from one tick to the next. */
	if (!digest->turning)
		memcpy(digest->line, opening.along, sizeof(digest->line));
	v3_rotate(flat, tick->quaternion, digest->scalpel.side);
	v3_cross(across, tick->normal, digest->line);
	along_part = v3_dot(flat, digest->line);
	across_part = v3_dot(flat, across);
	if (across_part < 0) {
		along_part = -along_part;
		across_part = -across_part;
	}
	add_angle(digest, atan2(along_part, across_part) * 180 / M_PI);
}

static void see_tube(struct session_digest *digest, const struct incise_tick *tick,
		     double t_s, double force_N)
{
	struct session *s = &digest->session;

	s->insertion.force_N = fmax(s->insertion.force_N, force_N);
	s->insertion.depth_mm = fmax(s->insertion.depth_mm, tick->depth_mm);
	s->insertion.seated_mm = tick->depth_mm;
	if (!isnan(s->insertion.placed_s) &&
	    !(tick->depth_mm > digest->placed_mm + PLACED_MM))
		return;
	digest->placed_mm = tick->depth_mm;
	s->insertion.placed_s = t_s;
}

static void meet(struct session_digest *digest, const struct incise_tick *tick,
		 double t_s, double off_mm)
{
	struct session *s = &digest->session;

	digest->hit = tick->flags & (INCISE_TICK_MEMBRANE | INCISE_TICK_LUMEN);
	if (!digest->hit) {
		s->target.missed++;
		s->target.missed_mm = fmin(s->target.missed_mm, off_mm);
	} else if (!s->target.hit) {
		s->target.hit = true;
		s->target.tool = tick->tool;
		s->target.t_s = t_s;
		s->target.off_axis_mm = off_mm;
	}
}

static void see_membrane(struct session_digest *digest, const struct incise_tick *tick,
			 double t_s)
{
	struct session *s = &digest->session;
	double off[3], across[3], beyond_mm;
	bool at_wall;

	v3_add(off, tick->tool_mm, -1, s->membrane.point_mm);
	beyond_mm = -v3_dot(off, s->membrane.normal);
	if (tick->phase == INCISE_PHASE_FREE || !(beyond_mm > 0)) {
		digest->met = digest->at_wall = false;
		return;
	}
	v3_add(across, off, beyond_mm, s->membrane.normal);
	if (!digest->met)
		meet(digest, tick, t_s, v3_length(across));
	digest->met = true;
	s->target.punctured |= digest->hit && tick->flags & INCISE_TICK_LUMEN;
	at_wall = tick->flags & INCISE_TICK_BACK_WALL;
	s->back_wall.touched += at_wall && !digest->at_wall;
	if (at_wall)
		s->back_wall.deepest_mm = fmax(s->back_wall.deepest_mm,
					       beyond_mm - s->membrane.back_wall_mm);
	digest->at_wall = at_wall;
}

/* --- the trace ------------------------------------------------------------------------- */

/* Half as many samples: of each pair its start, and its largest depth and force. */
static void halve_trace(struct session *s)
{
	for (int i = 0; i < SESSION_TRACE_MAX / 2; i++) {
		const struct session_sample *next = &s->trace[2 * i + 1];
		struct session_sample sample = s->trace[2 * i];

		if (sample.tool == INCISE_TOOL_AUTO)
			sample.tool = next->tool;
		sample.depth_mm = fmax(sample.depth_mm, next->depth_mm);
		sample.force_N = fmax(sample.force_N, next->force_N);
		s->trace[i] = sample;
	}
	s->n_trace = SESSION_TRACE_MAX / 2;
	s->trace_s *= 2;
}

/* Shorter once the tool is in the tissue. */
static double sample_end_s(const struct session *s, const struct session_sample *sample,
			   enum incise_tool tool)
{
	bool air = sample->tool == INCISE_TOOL_AUTO && tool == INCISE_TOOL_AUTO;

	return sample->t_s + s->trace_s * (air ? AIR_LONGER : 1);
}

static void add_sample(struct session_digest *digest, const struct incise_tick *tick,
		       double t_s, double force_N)
{
	bool in_tissue = tick->phase != INCISE_PHASE_FREE;
	enum incise_tool tool = in_tissue ? tick->tool : INCISE_TOOL_AUTO;
	struct session *s = &digest->session;
	struct session_sample *last = s->n_trace ? &s->trace[s->n_trace - 1] : NULL;

	if (last && t_s < sample_end_s(s, last, tool)) {
		if (last->tool == INCISE_TOOL_AUTO)
			last->tool = tool;
		last->depth_mm = fmax(last->depth_mm, tick->depth_mm);
		last->force_N = fmax(last->force_N, force_N);
		return;
	}
	if (s->n_trace == SESSION_TRACE_MAX)
		halve_trace(s);
	last = &s->trace[s->n_trace++];
	*last = (struct session_sample){
		.t_s = t_s, .depth_mm = tick->depth_mm, .force_N = force_N, .tool = tool};
	memcpy(last->tool_mm, tick->tool_mm, sizeof(last->tool_mm));
}

/* --- ticks ----------------------------------------------------------------------------- */

static bool is_within_digest(const double v[3], double most)
{
	return fabs(v[0]) <= most && fabs(v[1]) <= most && fabs(v[2]) <= most;
}

/* Ticks of a page are another program's, and may be anything. */
static bool is_usable(const struct session_digest *digest, const struct incise_tick *tick)
{
	double since_s;

	if (digest->started && tick->t_ns < digest->last_ns)
		return false;
	since_s = digest->started ? ((double)tick->t_ns - (double)digest->first_ns) /
					    INCISE_NS_PER_S
				  : 0;
	return since_s <= SESSION_TIME_MAX_S &&
	       is_within_digest(tick->tool_mm, SESSION_PLACE_MAX_MM) &&
	       is_within_digest(tick->proxy_mm, SESSION_PLACE_MAX_MM) &&
	       is_within_digest(tick->normal, 2) &&
	       is_within_digest(tick->quaternion, 2) && fabs(tick->quaternion[3]) <= 2 &&
	       is_within_digest(tick->command_N, SESSION_FORCE_MAX_N / 2) &&
	       tick->depth_mm >= 0 && tick->depth_mm <= SESSION_PLACE_MAX_MM &&
	       tick->phase <= INCISE_PHASE_INSERTION && tick->tool <= INCISE_TOOL_TUBE &&
	       (tick->phase == INCISE_PHASE_FREE || tick->tool != INCISE_TOOL_AUTO);
}

void session_digest_tick(struct session_digest *digest, const struct incise_tick *tick)
{
	struct session *s = &digest->session;
	double force_N, t_s;

	s->ticks++;
	if (!is_usable(digest, tick)) {
		s->unusable++;
		return;
	}
	if (!digest->started)
		digest->first_ns = tick->t_ns;
	digest->started = true;
	digest->last_ns = tick->t_ns;
	t_s = (double)(tick->t_ns - digest->first_ns) / INCISE_NS_PER_S;
	force_N = v3_length(tick->command_N);
	s->duration_s = t_s;
	incise_incision_tick(digest->incision, tick);
	s->cuts_full |= tick->flags & INCISE_TICK_FULL;
	if (force_N > s->force.largest_N) {
		s->force.largest_N = force_N;
		s->force.t_s = t_s;
		s->force.tool = tick->tool;
	}
	add_phase(digest, tick, t_s, force_N);
	s->insertion.seated_mm = 0;
	if (tick->phase == INCISE_PHASE_INSERTION && tick->tool == INCISE_TOOL_TUBE)
		see_tube(digest, tick, t_s, force_N);
	if (tick->phase == INCISE_PHASE_INSERTION && tick->tool == INCISE_TOOL_HANDLE)
		see_handle(digest, tick, force_N);
	else
		digest->turning = false;
	if (s->has_membrane)
		see_membrane(digest, tick, t_s);
	add_sample(digest, tick, t_s, force_N);
}

void session_digest_lost(struct session_digest *digest, uint64_t lost)
{
	digest->session.lost = (double)lost;
}

/* --- the end --------------------------------------------------------------------------- */

/* Distance of the membrane's axis from the line between two places, seen along it. */
static double off_axis_mm(const struct incise_scene_membrane *membrane,
			  const double from_mm[3], const double to_mm[3])
{
	double way[3], off[3], length2, share;

	v3_add(way, to_mm, -1, from_mm);
	v3_add(off, membrane->point_mm, -1, from_mm);
	v3_add(way, way, -v3_dot(way, membrane->normal), membrane->normal);
	v3_add(off, off, -v3_dot(off, membrane->normal), membrane->normal);
	length2 = v3_dot(way, way);
	share = length2 > 0 ? fmax(0, fmin(v3_dot(off, way) / length2, 1)) : 0;
	v3_add(off, off, -share, way);
	return v3_length(off);
}

static double direction_deg(const double along[3])
{
	double deg = atan2(along[1], along[0]) * 180 / M_PI;

	if (deg <= -90)
		return deg + 180;
	return deg > 90 ? deg - 180 : deg;
}

static void sum_up_cut(const struct session *s, const struct incise_cut *cut,
		       struct session_cut *to)
{
	int first = incise_cut_place(cut->from_mm), last = incise_cut_place(cut->to_mm);
	double depth_mm[INCISE_CUT_PLACES];
	int n = 0;

	*to = (struct session_cut){.incision = cut->incision,
				   .length_mm = cut->to_mm - cut->from_mm,
				   .direction_deg = direction_deg(cut->along),
				   .off_target_mm = NAN};
	v3_add(to->from_mm, cut->at_mm, cut->from_mm, cut->along);
	v3_add(to->to_mm, cut->at_mm, cut->to_mm, cut->along);
	for (int i = first; i <= last; i++) {
		depth_mm[n++] = cut->place[i].depth_mm;
		to->depth_mm = fmax(to->depth_mm, cut->place[i].depth_mm);
		to->open_mm = fmax(to->open_mm, cut->place[i].open_mm);
	}
	to->depth_median_mm = median(depth_mm, n);
	if (s->has_membrane)
		to->off_target_mm = off_axis_mm(&s->membrane, to->from_mm, to->to_mm);
}

struct session *session_digest_now(struct session_digest *digest)
{
	struct session *s = &digest->session;
	double end_s = isnan(s->insertion.placed_s) ? s->last_s : s->insertion.placed_s;

	s->needed_s = end_s - s->first_s;
	s->n_cuts = incise_incision_cuts(digest->incision);
	for (int i = 0; i < s->n_cuts; i++) {
		sum_up_cut(s, incise_incision_cut(digest->incision, i), &s->cut[i]);
		s->enlarging.open_mm = fmax(s->enlarging.open_mm, s->cut[i].open_mm);
	}
	return s;
}
