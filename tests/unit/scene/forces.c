// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Each force of paper 2, in both kinds of numbers, compared with its formula, written out here by
 * components. Then the phases of each force.
 */
#include "../unit.h"
#include "../../../lib/base/vector.h"
#include "../../../lib/scene/plan.h"
#include "felt.h"

/* The numbers of a case, in mm, N and s. */
struct given {
	enum incise_phase phase;
	enum incise_tool held;
	double depth, p[3], p0[3], normal[3], side[3], v[3];
	double attitude[4], flat[3]; /* of the handle: as it lies, and as it is made */
	double made[3], axis[3];
	bool in, printed;
	double cut, along[3], tightness, open;
	double number[INCISE_FORCES][INCISE_FORCE_NUMBERS];
};

#define FORCE(...)
#define MORE(member)
#define Q16 65536.0
#define Q28 268435456.0

static void give_double(const struct given *g, struct incise_double_numbers *to)
{
#define NUMBER(row, i, member, ...) to->member = g->number[INCISE_FORCE_##row][i];
#include "../../../lib/tissue/forces.def"
#undef NUMBER
}

static void give_fixed(const struct given *g, struct incise_fixed_numbers *to)
{
#define NUMBER(row, i, member, scale, ...) \
	to->member = (int32_t)lrint(scale * g->number[INCISE_FORCE_##row][i]);
#include "../../../lib/tissue/forces.def"
#undef NUMBER
}

/* Add a force to what is there: the same in both kinds of numbers. */
#define ADD(kind, n, d, back)                                                       \
	static void add_##kind(const struct given *g, int row, double force[3])     \
	{                                                                           \
		struct incise_##kind##_plan plan = {.numbers.printed = g->printed}; \
		static struct incise_##kind##_state state;                          \
		struct incise_##kind##_tick tick = {.phase = (int32_t)g->phase};    \
                                                                                    \
		give_##kind(g, &plan.numbers);                                      \
		memset(&state, 0, sizeof(state));                                   \
		state.held = (int32_t)g->held;                                      \
		state.depth = n(g->depth);                                          \
		state.opening.in = g->in;                                           \
		state.opening.depth_mm = n(g->cut);                                 \
		state.tightness = n(g->tightness);                                  \
		state.open = n(g->open);                                            \
		for (int i = 0; i < 4; i++)                                         \
			state.attitude[i] = d(g->attitude[i]);                      \
		for (int i = 0; i < 3; i++) {                                       \
			tick.tool[i] = n(g->p[i]);                                  \
			state.p0[i] = n(g->p0[i]);                                  \
			state.velocity[i] = n(g->v[i]);                             \
			state.normal[i] = state.entry[i] = d(g->normal[i]);         \
			state.side[i] = d(g->side[i]);                              \
			state.flat[i] = d(g->flat[i]);                              \
			state.opening.along[i] = d(g->along[i]);                    \
			state.tears.kept[0].line.along[i] = d(g->along[i]);         \
			plan.numbers.axis[i] = d(g->axis[i]);                       \
			plan.numbers.side[i] = d(g->made[i]);                       \
			state.force[i] = n(force[i]);                               \
		}                                                                   \
		incise_tissue_forces[row].stage.in_##kind(&plan, &state, &tick);    \
		for (int i = 0; i < 3; i++)                                         \
			force[i] = state.force[i] back;                             \
	}

#define AS_IS(x) (x)
#define in_fixed in_integers

static int32_t q16(double x)
{
	return (int32_t)lrint(x * 65536);
}

static int32_t q30(double x)
{
	return (int32_t)lrint(x * 1073741824);
}

/* clang-format off */
ADD(double, AS_IS, AS_IS, )
ADD(fixed, q16, q30, / 65536.0)
/* clang-format on */

/*
 * Products of three numbers up to 50 and some sums: a dozen roundings of 1e5 · 2^-53; of integers half a
 * bit of a stiffness over 170 mm, and of a length for 4 N/mm.
 * The second is for cases of small numbers: some ulp of 3, or three bits of 2^-16.
 */
static const struct kind {
	void (*add)(const struct given *g, int row, double force[3]);
	double rounding, ulp;
} kinds[] = {{add_double, 1e-9, 1e-14}, {add_fixed, 2e-3, 5e-5}}, *kind;
#define EACH_KIND \
	for (kind = kinds; kind < kinds + sizeof(kinds) / sizeof(*kinds); kind++)

static void reaction(double force[3], double size_N, const double n[3])
{
	struct given g = {.phase = INCISE_PHASE_CUTTING,
			  .depth = size_N,
			  .number[INCISE_FORCE_REACTION][0] = 1};

	v3_copy(g.normal, n);
	kind->add(&g, INCISE_FORCE_REACTION, force);
}

/* In a cut that is so deep the blade meets a share of it. */
TEST(test_a_blade_in_an_open_cut)
{
	static const struct {
		double depth, open, want;
	} cases[] = {{8, 0, 4}, {8, 3, 2.65}, {8, 8, 0.4}, {8, 20, 0.4}, {0, 3, 0}};

	EACH_KIND
	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct given g = {.phase = INCISE_PHASE_CUTTING,
				  .depth = cases[i].depth,
				  .open = cases[i].open,
				  .normal = {0, 0, 1},
				  .number[INCISE_FORCE_REACTION] = {0.5, 0, 0.1}};
		double force[3] = {0};

		kind->add(&g, INCISE_FORCE_REACTION, force);
		assert_true(fabs(force[2] - cases[i].want) < kind->ulp);
	}
}

static void plane(double force[3], double k_N_mm, const double p[3], const double p0[3],
		  const double side[3])
{
	struct given g = {.phase = INCISE_PHASE_CUTTING,
			  .number[INCISE_FORCE_PLANE][0] = k_N_mm};

	v3_copy(g.p, p);
	v3_copy(g.p0, p0);
	v3_copy(g.side, side);
	kind->add(&g, INCISE_FORCE_PLANE, force);
}

static void damping(double force[3], double k_N_s_mm, const double v[3])
{
	struct given g = {.phase = INCISE_PHASE_CUTTING,
			  .number[INCISE_FORCE_DAMPING][0] = k_N_s_mm};

	v3_copy(g.v, v);
	kind->add(&g, INCISE_FORCE_DAMPING, force);
}

static void spread(double force[3], double k_N_mm, const double p[3], const double p0[3],
		   const double n[3])
{
	struct given g = {.phase = INCISE_PHASE_INSERTION,
			  .number[INCISE_FORCE_SPREAD][0] = k_N_mm};

	v3_copy(g.p, p);
	v3_copy(g.p0, p0);
	v3_copy(g.normal, n);
	kind->add(&g, INCISE_FORCE_SPREAD, force);
}

/* Fort: of a handle in a cut along @along whose flat's normal is @flat, 1 N deep. */
static double orientation(const double flat[3], const double along[3], double aligned)
{
	struct given g = {.phase = INCISE_PHASE_INSERTION,
			  .held = INCISE_TOOL_HANDLE,
			  .depth = 1,
			  .normal = {0, 0, 1},
			  .in = true,
			  .cut = 1,
			  .tightness = 1,
			  .number[INCISE_FORCE_INSERTION] = {1, aligned}};
	double force[3] = {0};

	v3_copy(g.flat, flat);
	v3_copy(g.along, along);
	kind->add(&g, INCISE_FORCE_INSERTION, force);
	return force[2];
}

#define CASES 2000
#define ROUNDING (kind->rounding)

static double dot(const double a[3], const double b[3])
{
	return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static double any(double most)
{
	return most * (2.0 * rand() / RAND_MAX - 1);
}

static void any_vector(double v[3], double most)
{
	for (int i = 0; i < 3; i++)
		v[i] = any(most);
}

static void any_unit(double v[3])
{
	double length;

	do {
		any_vector(v, 1);
		length = sqrt(dot(v, v));
	} while (length < 0.1 || length > 1);
	for (int i = 0; i < 3; i++)
		v[i] /= length;
}

static void assert_vector(const double got[3], const double want[3])
{
	for (int i = 0; i < 3; i++)
		assert_true(fabs(got[i] - want[i]) < ROUNDING);
}

/* The formula as the paper prints it, with its signs. */
static void printed_fn(double f[3], double k, const double p[3], const double p0[3],
		       const double sn[3])
{
	double along =
		(p[0] - p0[0]) * sn[0] + (p[1] - p0[1]) * sn[1] + (p[2] - p0[2]) * sn[2];

	for (int i = 0; i < 3; i++)
		f[i] = -k * along * sn[i];
}

/* Each adds to what is there already. */
static void formulas(void)
{
	srand(1);
	for (int c = 0; c < CASES; c++) {
		double was[3], n[3], p[3], p0[3], v[3], got[3], want[3];
		double k = 2 + any(2), size = 5 + any(5), off;

		any_vector(was, 4);
		any_unit(n);
		any_vector(p, 50);
		any_vector(p0, 50);
		any_vector(v, 200);

		memcpy(got, was, sizeof(got));
		reaction(got, size, n);
		for (int i = 0; i < 3; i++)
			want[i] = was[i] + size * n[i];
		assert_vector(got, want);

		/* Fx is printed as it is meant: the same formula as Fn, along Sx(0). */
		memcpy(got, was, sizeof(got));
		plane(got, k, p, p0, n);
		printed_fn(want, k, p, p0, n);
		for (int i = 0; i < 3; i++)
			want[i] += was[i];
		assert_vector(got, want);

		memcpy(got, was, sizeof(got));
		damping(got, k, v);
		for (int i = 0; i < 3; i++)
			want[i] = was[i] - k * v[i];
		assert_vector(got, want);

		/* The matrix I - n nᵀ in full. */
		memcpy(got, was, sizeof(got));
		spread(got, k, p, p0, n);
		for (int i = 0; i < 3; i++) {
			off = 0;
			for (int j = 0; j < 3; j++)
				off += ((i == j) - n[i] * n[j]) * (p[j] - p0[j]);
			want[i] = was[i] - k * off;
		}
		assert_vector(got, want);
	}
}

TEST(test_formulas)
{
	EACH_KIND
	formulas();
}

/*
 * "Easily inserted if it is oriented along the cut direction": the flat's normal is then
 * across the cut. Turned by t about the normal of the surface it is aligned +
 * (1 - aligned) |sin t|.
 */
static void turn_of_a_handle(void)
{
	static const double along[3] = {1, 0, 0};

	for (int a = 0; a <= 10; a++) {
		double aligned = a / 10.0;

		for (int t = -180; t <= 180; t += 5) {
			double flat[3] = {-sin(t * M_PI / 180), cos(t * M_PI / 180), 0};
			double fort = orientation(flat, along, aligned);
			double want = aligned + (1 - aligned) * fabs(sin(t * M_PI / 180));

			assert_true(fort >= aligned - kind->ulp && fort <= 1);
			assert_true(fabs(fort - want) < kind->ulp);
		}
	}
	/* A product that rounding makes larger than 1 does not. */
	assert_true(orientation((double[]){1 + 1e-12, 0, 0}, along, 0.2) == 1);
}

TEST(test_orientation)
{
	EACH_KIND
	turn_of_a_handle();
}

/* 2 mm deep, 1 mm to both sides of where the contact began, at 10 mm/s along x. */
static struct given given_in_tissue(enum incise_phase phase)
{
	return (struct given){
		.phase = phase,
		.held = phase == INCISE_PHASE_INSERTION ? INCISE_TOOL_HANDLE
							: INCISE_TOOL_BLADE,
		.depth = 2,
		.p = {1, 1, -2},
		.normal = {0, 0, 1},
		.side = {0, 1, 0},
		.v = {10, 0, 0},
		.attitude = {1},
		.flat = {0, 1, 0},
		.made = {0, 1, 0},
		.axis = {0, 0, 1},
		.in = true,
		.cut = 2,
		.along = {1, 0, 0},
		.tightness = 1,
		.number = {[INCISE_FORCE_REACTION] = {0.5},
			   [INCISE_FORCE_PLANE] = {0.25},
			   [INCISE_FORCE_DAMPING] = {0.01},
			   [INCISE_FORCE_INSERTION] = {0.75, 0.2},
			   [INCISE_FORCE_SPREAD] = {0.125},
			   [INCISE_FORCE_FRACTURE] = {0.375, 1},
			   [INCISE_FORCE_SKIN] = {0.5, 0.1}},
	};
}

/* Also that no force is without a case here. */
TEST(test_each_force_has_its_phases)
{
	static const struct {
		const char *name;
		double cutting_N[3], insertion_N[3];
	} cases[] = {
		{"reaction", {0, 0, 1}, {0}},
		{"plane", {0, -0.25, 0}, {0}},
		{"damping", {-0.1, 0, 0}, {-0.1, 0, 0}},
		/* The flat side along the cut: aligned. */
		{"insertion", {0}, {0, 0, 0.3}},
		{"spread", {0}, {-0.125, -0.125, 0}},
		/* 1 mm beyond its tip, of 2 mm for 2 mm of depth. */
		{"fracture", {-0.375, 0, 0}, {0}},
		/* It slips: a tenth of the 3 N that are there, against √2 mm of stretch. */
		{"skin",
		 {-0.3 * M_SQRT1_2, -0.3 * M_SQRT1_2, 0},
		 {-0.3 * M_SQRT1_2, -0.3 * M_SQRT1_2, 0}},
	};
	assert_int_equal(sizeof(cases) / sizeof(*cases), incise_n_tissue_forces);
	for (int i = 0; i < incise_n_tissue_forces; i++) {
		assert_string_equal(cases[i].name, incise_tissue_forces[i].name);
		assert_non_null(incise_tissue_forces[i].number[0].key);
		assert_non_null(incise_tissue_forces[i].does);
	}
	EACH_KIND
	for (int k = 0; k < incise_n_tissue_forces * 3; k++) {
		enum incise_phase phase = k % 3;
		const double none[3] = {0}, before[3] = {1, 2, 3};
		const double *want =
			phase == INCISE_PHASE_CUTTING	  ? cases[k / 3].cutting_N
			: phase == INCISE_PHASE_INSERTION ? cases[k / 3].insertion_N
							  : none;
		struct given g = given_in_tissue(phase);
		double force[3];

		/* Its row says just these phases. */
		assert_int_equal(incise_tissue_forces[k / 3].phases >> phase & 1,
				 v3_length(want) > 0);
		/* Added to what is there. */
		v3_copy(force, before);
		kind->add(&g, k / 3, force);
		for (int i = 0; i < 3; i++)
			if (!(fabs(force[i] - before[i] - want[i]) <= kind->ulp))
				fail_msg("%s in phase %d: part %d is %.17g",
					 cases[k / 3].name, phase, i,
					 force[i] - before[i]);
	}
}

/* 2 mm deep with 0.75 N/mm, in a cut of 1.5 mm. */
TEST(test_insertion_by_turn_and_opening)
{
	/* A quarter turn about z lays the flat across the cut. */
	static const double as_is[4] = {1, 0, 0, 0},
			    across[4] = {M_SQRT1_2, 0, 0, M_SQRT1_2};
	static const struct {
		const double *attitude;
		enum incise_tool tool;
		bool in, paper;
		double tightness, want_mm; /* of uncut skin, that would resist as much */
	} cases[] = {
		{as_is, INCISE_TOOL_HANDLE, true, false, 1, 0.5 + 1.5 * 0.2},
		{across, INCISE_TOOL_HANDLE, true, false, 1, 2},
		{as_is, INCISE_TOOL_HANDLE, true, false, 0.5, 0.5 + 1.5 * 0.2},
		{across, INCISE_TOOL_HANDLE, true, false, 0.5, 0.5 + 1.5 * 0.6},
		{across, INCISE_TOOL_HANDLE, true, false, 0, 0.5 + 1.5 * 0.2},
		{as_is, INCISE_TOOL_TUBE, true, false, 0.5, 0.5 + 1.5 * 0.6},
		{across, INCISE_TOOL_TUBE, true, false, 0.5, 0.5 + 1.5 * 0.6},
		{as_is, INCISE_TOOL_TUBE, true, false, 0, 0.5 + 1.5 * 0.2},
		{as_is, INCISE_TOOL_HANDLE, false, false, 0, 2},
		{as_is, INCISE_TOOL_TUBE, false, false, 0, 2},
		/* The product as printed resists along the cut. */
		{as_is, INCISE_TOOL_HANDLE, true, true, 0.5, 2},
		{across, INCISE_TOOL_HANDLE, true, true, 0.5, 0},
		/* … of a handle; a tube has no flat side. */
		{as_is, INCISE_TOOL_TUBE, true, true, 0.5, 0.5 + 1.5 * 0.6},
		{across, INCISE_TOOL_TUBE, true, true, 0.5, 0.5 + 1.5 * 0.6},
	};

	for (size_t i = 0; i < 2 * sizeof(cases) / sizeof(*cases); i++) {
		struct given g = given_in_tissue(INCISE_PHASE_INSERTION);
		double force[3] = {0};

		kind = &kinds[i % 2];
		g.printed = cases[i / 2].paper;
		g.in = cases[i / 2].in;
		g.cut = 1.5;
		g.tightness = cases[i / 2].tightness;
		g.held = cases[i / 2].tool;
		memcpy(g.attitude, cases[i / 2].attitude, sizeof(g.attitude));
		v3_rotate(g.flat, g.attitude, g.made);
		kind->add(&g, INCISE_FORCE_INSERTION, force);
		if (!(fabs(force[2] - 0.75 * cases[i / 2].want_mm) < kind->ulp))
			fail_msg("case %zu: %.17g N", i, force[2]);
	}
}

/* A model of one force everywhere: it pushes, and does not pull. */
TEST(test_tissue_does_not_pull_and_gain_counts)
{
	struct incise_model *model = paper_model(INCISE_MF_GAUSS, 1, 0.1);

	for (int sign = -1; sign <= 1; sign += 2) {
		for (int r = 0; r < 20; r++) {
			double p[] = {sign * 0.5, 0, 0};

			incise_model_set_consequent(model, r, p);
		}
		for (int deep = 0; deep < 2; deep++) {
			struct incise_double_plan plan = {
				.numbers = {.gain = 3, .support = 1},
				.has_model = true,
				.model = {model},
				.inputs = {0x21},
			};
			struct incise_double_state state = {.depth = deep,
							    .normal = {0, 0, 1}};
			struct incise_double_tick tick = {.phase = INCISE_PHASE_CUTTING};

			incise_double_stage_reaction(&plan, &state, &tick);
			/* Weights that add up to 1 within some ulp. */
			assert_true(fabs(state.force[2] - (sign > 0 && deep ? 1.5 : 0)) <
				    1e-14);
		}
	}
	incise_model_free(model);
}
