// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A compiled model as a C file of its own, for a microcontroller: the blob's numbers as
 * constant tables, and the arithmetic of lib/fixed with this model's formats filled in.
 * Its outputs equal incise_fixed_eval()'s to the bit; a test compiles it.
 */
#include <ctype.h>
#include <errno.h>
#include <inttypes.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <incise/fixed.h>
#include <incise/outfile.h>
#include <incise/version.h>
#include "../fixed/layout.h"

#define SYMBOL_MAX 60

/* --- the arithmetic, as text; see lib/fixed/eval.c, and keep both alike --- */

static const char clamp_text[] =
	"/* Distance from the support's lower end, clamped. */\n"
	"static uint32_t from_min(int32_t x, int32_t min, int32_t max)\n"
	"{\n"
	"\tif (x < min)\n"
	"\t\tx = min;\n"
	"\tif (x > max)\n"
	"\t\tx = max;\n"
	"\treturn (uint32_t)x - (uint32_t)min;\n"
	"}\n\n";

static const char lerp_text[] =
	"/* Between two values, frac of 2^shift of the way, floored. */\n"
	"static int64_t lerp(int64_t from, int64_t to, uint32_t frac, int shift)\n"
	"{\n"
	"\treturn from + (((to - from) * (int64_t)frac) >> shift);\n"
	"}\n\n";

static const char round_text[] =
	"/* A value in Q(SHIFT_OUT) to Q16, rounded. */\n"
	"static int32_t rounded(int64_t y)\n"
	"{\n"
	"\ty = (y + ((int64_t)1 << (SHIFT_OUT - 17))) >> (SHIFT_OUT - 16);\n"
	"\tif (y > INT32_MAX)\n"
	"\t\treturn INT32_MAX;\n"
	"\treturn y < INT32_MIN ? INT32_MIN : (int32_t)y;\n"
	"}\n\n";

/* One input: both kinds of tables. */
static const char line_text[] =
	"{\n"
	"\tuint32_t at = from_min(x[0], MIN_0, MAX_0);\n"
	"\tconst int32_t *v = table + (at >> CELL_0);\n\n"
	"\treturn rounded(lerp(v[0], v[1], at & ((1u << CELL_0) - 1), CELL_0));\n"
	"}\n";

static const char force_text[] =
	"{\n"
	"\tuint32_t a = from_min(x[0], MIN_0, MAX_0), b = from_min(x[1], MIN_1, MAX_1);\n"
	"\tuint32_t frac = b & ((1u << CELL_1) - 1);\n"
	"\tconst int32_t *v = table + (a >> CELL_0) * KNOTS_1 + (b >> CELL_1);\n\n"
	"\treturn rounded(lerp(lerp(v[0], v[1], frac, CELL_1),\n"
	"\t\t\t    lerp(v[KNOTS_1], v[KNOTS_1 + 1], frac, CELL_1),\n"
	"\t\t\t    a & ((1u << CELL_0) - 1), CELL_0));\n"
	"}\n";

static const char table_text[] =
	"{\n"
	"\tuint32_t a = from_min(x[0], MIN_0, MAX_0), b = from_min(x[1], MIN_1, MAX_1);\n"
	"\tconst int32_t *w = weights + (a >> CELL_0) * FUNCTIONS_0;\n"
	"\tconst int32_t *f = outputs + (b >> CELL_1) * (2 * FUNCTIONS_0);\n"
	"\tint64_t centred = (int64_t)a - (((int64_t)MAX_0 - MIN_0) >> 1);\n"
	"\tint64_t y[2];\n"
	"\tint i, k;\n\n"
	"\tfor (k = 0; k < 2; k++, f += 2 * FUNCTIONS_0) {\n"
	"\t\tint64_t g = 0, h = 0;\n\n"
	"\t\tfor (i = 0; i < FUNCTIONS_0; i++) {\n"
	"\t\t\tint64_t weight = lerp(w[i], w[FUNCTIONS_0 + i],\n"
	"\t\t\t\t\t      a & ((1u << CELL_0) - 1), CELL_0);\n\n"
	"\t\t\tg += weight * f[2 * i];\n"
	"\t\t\th += weight * f[2 * i + 1];\n"
	"\t\t}\n"
	"\t\ty[k] = (g >> 30) + ((centred * (h >> 30)) >> (16 + SHIFT_B - SHIFT_A));\n"
	"\t}\n"
	"\treturn rounded(lerp(y[0], y[1], b & ((1u << CELL_1) - 1), CELL_1));\n"
	"}\n";

static const char degrees_text[] =
	"/* 2^-q for q >= 0 in Q26; Q30. */\n"
	"static uint32_t exp2_neg(int64_t q)\n"
	"{\n"
	"\tstatic const int32_t c[] = {1073741823, -744260977, 257938963, -59583156,\n"
	"\t\t\t\t    10286722,   -1369979,   117517};\n"
	"\tint64_t f = q & ((1 << 26) - 1), a = c[6];\n"
	"\tint i;\n\n"
	"\tif (q >= (int64_t)31 << 26)\n"
	"\t\treturn 0;\n"
	"\tfor (i = 5; i >= 0; i--)\n"
	"\t\ta = ((a * f) >> 26) + c[i];\n"
	"\treturn (uint32_t)(a >> (q >> 26));\n"
	"}\n\n"
	"/* Degrees of n functions at x, the largest of them 1; Q30. */\n"
	"static void degrees(const struct function *mf, int n, int64_t x, uint32_t *mu)\n"
	"{\n"
	"\tconst int64_t z_max = INT32_MAX;\n"
	"\tint64_t q[FUNCTIONS_MAX], least = INT64_MAX;\n"
	"\tint k;\n\n"
	"\tfor (k = 0; k < n; k++) {\n"
	"\t\tint64_t z = (((x - mf[k].centre) * mf[k].slope) >> mf[k].shift) -\n"
	"\t\t\t    mf[k].offset;\n\n"
	"\t\tz = z > z_max ? z_max : z < -z_max ? -z_max : z;\n"
	"\t\tq[k] = (z * z) >> 22;\n"
	"\t\tleast = q[k] < least ? q[k] : least;\n"
	"\t}\n"
	"\tfor (k = 0; k < n; k++)\n"
	"\t\tmu[k] = exp2_neg(q[k] - least);\n"
	"}\n\n";

static const char direct_text[] =
	"{\n"
	"\tuint32_t a[FUNCTIONS_0], b[FUNCTIONS_1];\n"
	"\tint64_t xa = (int64_t)MIN_0 + from_min(x[0], MIN_0, MAX_0);\n"
	"\tint64_t xb = (int64_t)MIN_1 + from_min(x[1], MIN_1, MAX_1);\n"
	"\tconst int64_t *p = consequents;\n"
	"\tint64_t sum = 0, sum_w = 0;\n"
	"\tint i, j;\n\n"
	"\tdegrees(functions_0, FUNCTIONS_0, xa, a);\n"
	"\tdegrees(functions_1, FUNCTIONS_1, xb, b);\n"
	"\tfor (i = 0; i < FUNCTIONS_0; i++)\n"
	"\t\tfor (j = 0; j < FUNCTIONS_1; j++, p += 3) {\n"
	"\t\t\tint64_t w = (int64_t)(((uint64_t)a[i] * b[j]) >> 30);\n"
	"\t\t\tint64_t rule = p[0] * 65536 + p[1] * xa + p[2] * xb;\n\n"
	"\t\t\tsum += w * (rule >> (SHIFT_A + 16 - SHIFT_B));\n"
	"\t\t\tsum_w += w;\n"
	"\t\t}\n"
	"\treturn rounded(sum / sum_w);\n"
	"}\n";

static const char direct_one_text[] =
	"{\n"
	"\tuint32_t w[FUNCTIONS_0];\n"
	"\tint64_t xa = (int64_t)MIN_0 + from_min(x[0], MIN_0, MAX_0);\n"
	"\tconst int64_t *p = consequents;\n"
	"\tint64_t sum = 0, sum_w = 0;\n"
	"\tint i;\n\n"
	"\tdegrees(functions_0, FUNCTIONS_0, xa, w);\n"
	"\tfor (i = 0; i < FUNCTIONS_0; i++, p += 2) {\n"
	"\t\tint64_t rule = p[0] * 65536 + p[1] * xa;\n\n"
	"\t\tsum += w[i] * (rule >> (SHIFT_A + 16 - SHIFT_B));\n"
	"\t\tsum_w += w[i];\n"
	"\t}\n"
	"\treturn rounded(sum / sum_w);\n"
	"}\n";

/* Three inputs and more; before it the degrees of each. */
static const char direct_many_text[] =
	"\tfor (r = 0; r < RULES; r++, p += INPUTS + 1) {\n"
	"\t\tint64_t rule = p[0] * 65536;\n"
	"\t\tuint64_t w = 1 << 30;\n\n"
	"\t\tfor (i = 0; i < INPUTS; i++) {\n"
	"\t\t\tw = (w * mu[i][at[i]]) >> 30;\n"
	"\t\t\trule += p[i + 1] * in[i];\n"
	"\t\t}\n"
	"\t\tsum += (int64_t)w * (rule >> (SHIFT_A + 16 - SHIFT_B));\n"
	"\t\tsum_w += (int64_t)w;\n"
	"\t\tfor (i = INPUTS - 1; i >= 0 && ++at[i] == n[i]; i--)\n"
	"\t\t\tat[i] = 0;\n"
	"\t}\n"
	"\treturn rounded(sum / sum_w);\n"
	"}\n";

static void put_direct_many(FILE *out, const struct incise_fixed *fx)
{
	fputs("{\n\tstatic const int n[INPUTS] = {", out);
	for (int i = 0; i < fx->n_inputs; i++)
		fprintf(out, "%sFUNCTIONS_%d", i ? ", " : "", i);
	fputs("};\n\tuint32_t mu[INPUTS][FUNCTIONS_MAX];\n\tint64_t in[INPUTS], sum = 0, "
	      "sum_w = 0;\n\tconst int64_t *p = consequents;\n\tint at[INPUTS] = {0};\n"
	      "\tint i, r;\n\n",
	      out);
	for (int i = 0; i < fx->n_inputs; i++)
		fprintf(out,
			"\tin[%d] = (int64_t)MIN_%d + from_min(x[%d], MIN_%d, MAX_%d);\n"
			"\tdegrees(functions_%d, FUNCTIONS_%d, in[%d], mu[%d]);\n",
			i, i, i, i, i, i, i, i, i);
	fputs(direct_many_text, out);
}

/* --- the numbers --- */

static void put_array(FILE *out, const char *name, const int32_t *values, size_t n)
{
	fprintf(out, "static const int32_t %s[%zu] = {", name, n);
	for (size_t i = 0; i < n; i++)
		fprintf(out, "%s%" PRId32 ",", i % 8 ? " " : "\n\t",
			incise_fx_int32(values[i]));
	fputs("\n};\n\n", out);
}

static void put_functions(FILE *out, const struct incise_fixed *fx, int i)
{
	const int32_t *v = fx->input[i].values;

	fprintf(out, "static const struct function functions_%d[FUNCTIONS_%d] = {\n", i,
		i);
	for (int k = 0; k < fx->input[i].n_mfs; k++, v += 4)
		fprintf(out, "\t{%" PRId32 ", %" PRId32 ", %" PRId32 ", %" PRId32 "},\n",
			incise_fx_int32(v[0]), incise_fx_int32(v[1]),
			incise_fx_int32(v[2]), incise_fx_int32(v[3]));
	fputs("};\n\n", out);
}

static void put_consequents(FILE *out, const struct incise_fixed *fx)
{
	const int64_t *p = fx->data;
	int n = fx->n_inputs + 1;

	fprintf(out,
		"/* Per rule the constant, then a factor per input; Q(SHIFT_A). */\n"
		"static const int64_t consequents[%d] = {\n",
		fx->n_rules * n);
	for (int r = 0; r < fx->n_rules; r++) {
		fputc('\t', out);
		for (int k = 0; k < n; k++)
			fprintf(out, "INT64_C(%" PRId64 "),%c", incise_fx_int64(*p++),
				k + 1 < n ? ' ' : '\n');
	}
	fputs("};\n\n", out);
}

/* A name within a comment: nothing that could end it or warn. */
static void put_c_source_name(FILE *out, const char *name)
{
	for (; *name; name++)
		fputc(isascii(*name) && (isalnum(*name) || strchr(" ._-+(),", *name))
			      ? *name
			      : '_',
		      out);
}

static void put_comment(FILE *out, const struct incise_fixed *fx, const char *symbol)
{
	fputs("/* SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only */\n"
	      "/*\n * ",
	      out);
	put_c_source_name(out, fx->name);
	fprintf(out,
		": a fuzzy model of %" PRId32 " rules in fixed point, %s.\n"
		" * Written by incise %s from its compiled form; compile the model again "
		"rather than\n * edit this.\n *\n"
		" *     int32_t %s_eval(const int32_t *x);\n *\n",
		fx->n_rules, incise_fixed_arithmetic_name(fx->arithmetic),
		incise_version(), symbol);
	for (int i = 0; i < fx->n_inputs; i++) {
		fprintf(out, " * x[%d]     ", i);
		put_c_source_name(out, fx->input[i].name);
		fprintf(out, ", Q16.16; %.10g to %.10g, clamped\n",
			fx->input[i].min / (double)INCISE_FIXED_ONE,
			fx->input[i].max / (double)INCISE_FIXED_ONE);
	}
	fputs(" * returns  ", out);
	put_c_source_name(out, fx->output);
	fprintf(out,
		", Q16.16; within %.3g of the model in real numbers for every\n *      "
		"    input: a certified bound\n *\n * Q16.16: 65536 stands for 1 of "
		"the unit in the name. Needs 64-bit integers, and right\n * shifts of "
		"negative numbers that keep the sign, as compilers have them.\n */\n",
		incise_fixed_bound(fx));
}

static void put_formats(FILE *out, const struct incise_fixed *fx)
{
	fprintf(out, "#define SHIFT_A %" PRId32 "\n#define SHIFT_B %" PRId32 "\n",
		fx->shift_a, fx->shift_b);
	for (int i = 0; i < fx->n_inputs; i++) {
		const struct incise_fixed_input *in = &fx->input[i];

		/* INT32_MIN has no literal of its own type. */
		fprintf(out,
			"#define MIN_%d (%" PRId32 " - 1)\n#define MAX_%d %" PRId32 "\n"
			"#define FUNCTIONS_%d %" PRId32 "\n",
			i, in->min + 1, i, in->max, i, in->n_mfs);
		if (fx->arithmetic != INCISE_FIXED_DIRECT)
			fprintf(out,
				"#define CELL_%d %" PRId32 "\n#define KNOTS_%d %" PRId32
				"u\n",
				i, in->cell_shift, i, in->cells + 1);
	}
	if (fx->n_inputs > 2)
		fprintf(out, "#define INPUTS %" PRId32 "\n#define RULES %" PRId32 "\n",
			fx->n_inputs, fx->n_rules);
	fputc('\n', out);
}

static void put_direct(FILE *out, const struct incise_fixed *fx)
{
	int most = 0;

	for (int i = 0; i < fx->n_inputs; i++)
		most = fx->input[i].n_mfs > most ? fx->input[i].n_mfs : most;
	fprintf(out,
		"#define FUNCTIONS_MAX %d\n\n"
		"/* 2^-z^2, z = (x - centre) * slope >> shift, less offset; Q24. */\n"
		"struct function {\n\tint32_t centre, slope, shift, offset;\n};\n\n",
		most);
	for (int i = 0; i < fx->n_inputs; i++)
		put_functions(out, fx, i);
	put_consequents(out, fx);
	fputs(clamp_text, out);
	fputs(degrees_text, out);
}

static void put_tables(FILE *out, const struct incise_fixed *fx)
{
	size_t a = (size_t)fx->input[0].cells + 1, b = 1, n = (size_t)fx->input[0].n_mfs;

	if (fx->n_inputs > 1)
		b = (size_t)fx->input[1].cells + 1;
	if (fx->n_inputs > 1 && fx->arithmetic == INCISE_FIXED_TABLE) {
		fputs("/* Per knot of x[0] its functions' weights, which add up to 1; "
		      "Q30. */\n",
		      out);
		put_array(out, "weights", fx->input[0].values, a * n);
		fputs("/* Per knot of x[1] the outputs of x[0]'s functions at the middle "
		      "of x[0],\n * Q(SHIFT_A), each with its slope by x[0], Q(SHIFT_B). "
		      "*/\n",
		      out);
		put_array(out, "outputs", fx->data, b * 2 * n);
	} else {
		fputs("/* The output at the knots; Q(SHIFT_A). */\n", out);
		put_array(out, "table", fx->data, a * b);
	}
	fputs(clamp_text, out);
	fputs(lerp_text, out);
}

static void put_source(FILE *out, const struct incise_fixed *fx, const char *symbol)
{
	bool one = fx->n_inputs == 1;

	put_comment(out, fx, symbol);
	fprintf(out, "#include <stdint.h>\n\nint32_t %s_eval(const int32_t *x);\n\n",
		symbol);
	put_formats(out, fx);
	if (fx->arithmetic == INCISE_FIXED_DIRECT)
		put_direct(out, fx);
	else
		put_tables(out, fx);
	/* The direct arithmetic leaves its quotient in Q(shift_b). */
	if (fx->arithmetic == INCISE_FIXED_DIRECT)
		fputs("#define SHIFT_OUT SHIFT_B\n\n", out);
	else
		fputs("#define SHIFT_OUT SHIFT_A\n\n", out);
	fputs(round_text, out);
	fprintf(out, "int32_t %s_eval(const int32_t *x)\n", symbol);
	switch (fx->arithmetic) {
	case INCISE_FIXED_DIRECT:
		if (fx->n_inputs > 2)
			put_direct_many(out, fx);
		else
			fputs(one ? direct_one_text : direct_text, out);
		break;
	case INCISE_FIXED_TABLE:
		fputs(one ? line_text : table_text, out);
		break;
	case INCISE_FIXED_FORCE:
		fputs(one ? line_text : force_text, out);
		break;
	}
}

static bool is_identifier(const char *s)
{
	size_t n = strlen(s);

	if (n < 1 || n > SYMBOL_MAX || isdigit((unsigned char)*s))
		return false;
	for (; *s; s++)
		if (!isascii(*s) || !(isalnum((unsigned char)*s) || *s == '_'))
			return false;
	return true;
}

int incise_fixed_write_c(const struct incise_fixed *fx, const char *path,
			 const char *symbol, struct incise_error *err)
{
	struct incise_outfile *file;

	if (!is_identifier(symbol))
		return incise_error_set(
			err, EINVAL,
			"'%s' is not a name for a C function: expected at most %d "
			"letters, digits and '_', no digit first",
			symbol, SYMBOL_MAX);
	file = incise_outfile_open(path, err);
	if (!file)
		return -errno;
	put_source(incise_outfile_stream(file), fx, symbol);
	return incise_outfile_commit(file, err);
}
