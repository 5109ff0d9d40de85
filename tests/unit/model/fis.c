// SPDX-License-Identifier: GPL-2.0-or-later
/* .fis files: exact round trips, errors by line, and files that were tampered with. */
#include "../unit.h"
#include <locale.h>
#include <float.h>
#include "../cases.h"
#include "any_model.h"
#include "every_kind.h"

static char path[] = "/tmp/incise-fis-XXXXXX";

static int set_up(void **state)
{
	int fd;

	strcpy(strrchr(path, '-') + 1, "XXXXXX");
	fd = mkstemp(path);
	return fd < 0 ? -1 : close(fd);
}

static int tear_down(void **state)
{
	return unlink(path);
}

static void put(const char *text, size_t n)
{
	FILE *file = fopen(path, "w");

	assert_int_equal(fwrite(text, 1, n, file), n);
	assert_int_equal(fclose(file), 0);
}

static void assert_same(const struct incise_model *a, const struct incise_model *b)
{
	const struct incise_model_info *info = incise_model_info(a);

	assert_int_equal(info->n_rules, incise_model_info(b)->n_rules);
	assert_string_equal(info->name, incise_model_info(b)->name);
	for (int i = 0; i < 2; i++) {
		assert_string_equal(info->input[i].name,
				    incise_model_info(b)->input[i].name);
		assert_true(info->input[i].min == incise_model_info(b)->input[i].min);
		assert_true(info->input[i].max == incise_model_info(b)->input[i].max);
		for (int k = 0; k < info->n_mfs[i]; k++) {
			const struct incise_mf *f = incise_model_mf(a, i, k);
			const struct incise_mf *g = incise_model_mf(b, i, k);

			assert_int_equal(f->type, g->type);
			assert_string_equal(f->name, g->name);
			assert_memory_equal(f->p, g->p,
					    (f->type == INCISE_MF_GAUSS ? 2 : 3) *
						    sizeof(double));
		}
	}
	for (int r = 0; r < info->n_rules; r++)
		assert_memory_equal(incise_model_rule(a, r)->p,
				    incise_model_rule(b, r)->p, 3 * sizeof(double));
}

/* 17 digits carry every bit of a double. */
TEST(test_round_trip_is_exact)
{
	for (int type = INCISE_MF_GAUSS; type <= INCISE_MF_GBELL; type++)
		for (uint64_t seed = 1; seed < 10; seed++) {
			struct incise_model *model =
				paper_model(type, seed, 1e-9 * pow(1e3, seed));
			struct incise_model *back;

			paper_disturb(model, seed, 0.4);
			strcpy(model->info.name, "pig's liver");
			assert_int_equal(incise_model_save(model, path, NULL), 0);
			back = incise_model_load(path, NULL);
			assert_non_null(back);
			/* A quote would end the name early: it is replaced. */
			strcpy(model->info.name, "pig_s liver");
			assert_same(model, back);
			incise_model_free(model);
			incise_model_free(back);
		}
}

/* All that a model holds but its clamp, which is not the file's. */
static void assert_same_inside(const struct incise_model *a, const struct incise_model *b)
{
	assert_int_equal(a->info.n_inputs, b->info.n_inputs);
	assert_int_equal(a->info.n_rules, b->info.n_rules);
	assert_int_equal(a->info.and_method, b->info.and_method);
	assert_int_equal(a->is_grid, b->is_grid);
	assert_memory_equal(a->info.n_mfs, b->info.n_mfs,
			    a->info.n_inputs * sizeof(*a->info.n_mfs));
	assert_memory_equal(a->in_all, b->in_all, a->info.n_inputs * sizeof(*a->in_all));
	for (int i = 0; i < a->info.n_inputs; i++)
		for (int k = 0; k < a->info.n_mfs[i]; k++) {
			const struct incise_mf *f = &a->mf[i][k], *g = &b->mf[i][k];

			assert_int_equal(f->type, g->type);
			assert_memory_equal(f->p, g->p,
					    incise_mf_n_params(f->type) * sizeof(*f->p));
		}
	for (int r = 0; r < a->info.n_rules; r++) {
		const struct incise_rule *f = &a->rule[r], *g = &b->rule[r];

		assert_memory_equal(f->mf, g->mf, a->info.n_inputs);
		assert_int_equal(a->constant[r], b->constant[r]);
		assert_memory_equal(&f->weight, &g->weight, sizeof(f->weight));
		assert_memory_equal(f->p, g->p, (a->info.n_inputs + 1) * sizeof(*f->p));
	}
}

/* Of any model, to the bit: all kinds, lists, weights and methods, and the largest. */
TEST(test_any_model_round_trips)
{
	static const double extreme[] = {5e-324, DBL_MAX, -DBL_MIN, -0.0, 1e300, 0.1};
	struct incise_model *model = calloc(1, sizeof(*model)), *back;
	uint64_t seed = 7;

	for (int n = 0; n < 300; n++) {
		int n_inputs = n < 290 ? 1 + any_below(&seed, 8) : 8;
		int n_rules = n < 290 ? 1 + any_below(&seed, 20) : 256;

		any_model(model, &seed, n_inputs, n_rules, 12);
		for (size_t k = 0; k < 6; k++)
			model->rule[any_below(&seed, n_rules)].p[0] = extreme[k];
		if (n_rules > 1)
			model->rule[1].weight = 5e-324;
		assert_int_equal(incise_model_save(model, path, NULL), 0);
		back = incise_model_load(path, NULL);
		assert_non_null(back);
		assert_same_inside(model, back);
		incise_model_free(back);
	}
	free(model);
}

/* A constant that was given a slope keeps it. */
TEST(test_constants_become_linear)
{
	struct incise_model *model = paper_model(INCISE_MF_GAUSS, 1, 1), *back;

	for (int r = 0; r < 20; r++)
		model->constant[r] = true;
	for (int r = 0; r < 20; r++)
		incise_model_set_consequent(model, r, (double[]){1, 0, r == 4 ? 2 : 0});
	assert_int_equal(incise_model_save(model, path, NULL), 0);
	back = incise_model_load(path, NULL);
	for (int r = 0; r < 20; r++) {
		assert_int_equal(back->constant[r], r != 4);
		assert_true(incise_model_rule(back, r)->p[2] == (r == 4 ? 2 : 0));
	}
	incise_model_free(model);
	incise_model_free(back);
}

/* A program that has set a locale with a decimal comma writes and reads the same file. */
TEST(test_locale_does_not_matter)
{
	static const char *const names[] = {"de_DE.UTF-8", "de_DE.utf8", "fr_FR.UTF-8",
					    "nb_NO.UTF-8"};
	struct incise_model *model = paper_model(INCISE_MF_GAUSS, 1, 1), *back;
	const char *set = NULL;

	for (size_t i = 0; i < 4 && !set; i++)
		set = setlocale(LC_NUMERIC, names[i]);
	if (!set) {
		incise_model_free(model);
		print_message("skipped: no locale with a decimal comma is installed\n");
		skip();
	}
	assert_int_equal(incise_model_save(model, path, NULL), 0);
	back = incise_model_load(path, NULL);
	setlocale(LC_NUMERIC, "C");
	assert_non_null(back);
	assert_same(model, back);
	incise_model_free(model);
	incise_model_free(back);
}

/* As MATLAB writes it: other keys, comments, weights, constants, free rule lists. */
static const char matlab[] =
	"[System]\nName='tipper'\nType='sugeno'\nVersion=2.0\nNumInputs=2\nNumOutputs=1\n"
	"NumRules=3\nAndMethod='prod'\nOrMethod='probor'\nImpMethod='prod'\nAggMethod='sum'\n"
	"DefuzzMethod='wtaver'\n\n"
	"[Input1]\nName='depth'\nRange=[0 10]\nNumMFs=2\n"
	"MF1='low':'gaussmf',[2.5 0]\nMF2='high':'gbellmf',[2.5 2 10]\n\n"
	"% a comment\n"
	"[Input2]\r\nName='speed'\nRange=[-5 5]\nNumMFs=1\nMF1='any':'gaussmf',[4 0]\n\n"
	"[Output1]\nName='force'\nRange=[0 30]\nNumMFs=2\n"
	"MF1='weak':'constant',[3]\nMF2='strong':'linear',[1 2 0.5]\n\n"
	"[Rules]\n1 1, 1 (1) : 1\n2 0, 2 (0.5) : 1\n0 1, 2 (1) : 1\n";

TEST(test_matlab_file)
{
	struct incise_model *model;
	const double x[] = {4, 1};
	double low = exp(-16 / 12.5), high = 1 / (1 + pow(6 / 2.5, 4)),
	       any = exp(-1 / 32.0);
	double strong = 1 * 4 + 2 * 1 + 0.5;
	double want = (low * any * 3 + 0.5 * high * strong + any * strong) /
		      (low * any + 0.5 * high + any);

	put(matlab, strlen(matlab));
	model = incise_model_load(path, NULL);
	assert_non_null(model);
	assert_string_equal(incise_model_info(model)->name, "tipper");
	assert_true(fabs(incise_model_eval(model, x, NULL) - want) < 1e-14);
	/* A second generation says the same. */
	assert_int_equal(incise_model_save(model, path, NULL), 0);
	incise_model_free(model);
	model = incise_model_load(path, NULL);
	assert_true(fabs(incise_model_eval(model, x, NULL) - want) < 1e-14);
	incise_model_free(model);
}

/* Every kind of function, min, a weight of 0, and an 'or' of one input. */
TEST(test_every_kind)
{
	struct incise_model *model;
	const double x[] = {3, 0.5};
	/* trimf 1/4 < gaussmf; trapmf 1/2 = gbellmf 1/2; gauss2mf one s left of its c1. */
	double two = exp(-0.5);
	double want = (0.25 * 1 + 0.25 * 0.5 * 7 + two * 7) / (0.25 + 0.125 + two);

	put(every_kind, strlen(every_kind));
	model = incise_model_load(path, NULL);
	assert_non_null(model);
	assert_true(fabs(incise_model_eval(model, x, NULL) - want) < 1e-14);
	assert_int_equal(incise_model_info(model)->and_method, INCISE_AND_MIN);
	assert_true(incise_model_rule(model, 1)->weight == 0.25);
	assert_true(incise_model_rule(model, 2)->weight == 0);
	assert_int_equal(incise_model_rule(model, 3)->mf[1], -1);
	incise_model_free(model);
}

/* Replace the first occurrence in a text and load. */
static void load_changed(const char *whole, const char *from, const char *to,
			 struct incise_error *err)
{
	const char *at = strstr(whole, from);
	char text[2048];

	assert_non_null(at);
	snprintf(text, sizeof(text), "%.*s%s%s", (int)(at - whole), whole, to,
		 at + strlen(from));
	put(text, strlen(text));
	*err = (struct incise_error){0};
	assert_null(incise_model_load(path, err));
}

TEST(test_refusals_name_line_and_word)
{
	struct changed {
		const char *from, *to;
		int code, line;
		const char *word;
	};
	static const struct changed cases[] = {
		{"'sugeno'", "'mamdani'", ENOTSUP, 3, "mamdani"},
		{"'gbellmf'", "'pimf'", ENOTSUP, 19, "pimf"},
		{"AndMethod='prod'", "AndMethod='max'", ENOTSUP, 8, "'max'"},
		{"AndMethod='prod'", "AndMethod=prod", EINVAL, 8, "quotes"},
		{"'wtaver'", "'wtsum'", ENOTSUP, 12, "wtsum"},
		{"NumOutputs=1", "NumOutputs=2", E2BIG, 6, "NumOutputs"},
		{"NumInputs=2", "NumInputs=9", E2BIG, 5, "NumInputs"},
		{"NumRules=3", "NumRules=2", EINVAL, 38, "more rules"},
		{"NumRules=3", "NumRules=4", EINVAL, 38, "truncated"},
		{"[2.5 0]", "[2.5]", EINVAL, 18, "number 2"},
		{"[2.5 0]", "[2.5 0 1]", EINVAL, 18, "expected ']'"},
		{"[2.5 0]", "[0 0]", EINVAL, 18, "positive"},
		{"[2.5 0]", "[nan 0]", EINVAL, 18, "not finite"},
		{"[2.5 0]", "[2.5 1e999]", EINVAL, 18, "not finite"},
		{"Range=[0 10]", "Range=[10 0]", EINVAL, 16, "smaller"},
		{"1 1, 1 (1)", "1 2, 1 (1)", EINVAL, 36, "rule 1"},
		{"1 1, 1 (1)", "1 -1, 1 (1)", ENOTSUP, 36, "not"},
		{"1 1, 1 (1) : 1", "1 1, 1 (1) : 2", ENOTSUP, 36, "or"},
		{"1 1, 1 (1)", "1 1, 7 (1)", EINVAL, 36, "consequent"},
		{"(0.5)", "(1.5)", EINVAL, 37, "rule 2: expected a weight"},
		{"(0.5)", "(-0.5)", EINVAL, 37, "weight"},
		{"(0.5)", "(nan)", EINVAL, 37, "weight"},
		{"MF1='any'", "MF3='any'", E2BIG, 26, "MF"},
		{"[Output1]", "[Output2]", ENOTSUP, 28, "[Output2]"},
		{"[Output1]", "[Rules]", EINVAL, 28, "before [Output1]"},
		{"[Input2]", "[Input7]", EINVAL, 22, "NumInputs"},
		{"'linear'", "'quadratic'", ENOTSUP, 33, "quadratic"},
		{"[System]", "hello", EINVAL, 1, ".fis"},
		{"NumMFs=2\nMF1='low'", "MF1='low'", EINVAL, 17, "before NumMFs"},
		{"Range=[0 10]", "Range=[5 5]", EINVAL, 16, ""},
		{"Range=[0 10]", "Range=[nan 1]", EINVAL, 16, ""},
		{"Range=[0 10]", "Range=[0 inf]", EINVAL, 16, ""},
		{"Range=[0 10]", "Range=[-1e308 1e308]", EINVAL, 16, ""},
		{"[2.5 0]", "[a b]", EINVAL, 18, ""},
		{"[2.5 0]", "[]", EINVAL, 18, ""},
		{"[2.5 0]", "[2.5 0", EINVAL, 18, ""},
		{"[2.5 0]", "2.5 0", EINVAL, 18, ""},
		{"NumRules=3", "NumRules=0", EINVAL, 7, ""},
		{"NumRules=3", "NumRules=-1", EINVAL, 7, ""},
		{"NumRules=3", "NumRules=257", E2BIG, 7, ""},
		{"NumRules=3", "NumRules=99999999999999999999", E2BIG, 7, ""},
		{"NumRules=3", "NumRules=x", EINVAL, 7, ""},
		{"NumRules=3", "NumRules=", EINVAL, 7, ""},
		{"NumInputs=2", "NumInputs=0", EINVAL, 5, ""},
		{"NumInputs=2", "NumInputs=-1", EINVAL, 5, ""},
		/* A key that is not understood, a key twice, a key that lacks. */
		{"AndMethod", "andmethod", EINVAL, 8, "did you mean AndMethod"},
		{"Version=2.0", "Vision=2.0", EINVAL, 4, "'Vision'"},
		{"Version=2.0", "Range=[0 1]", EINVAL, 4, "unknown key"},
		{"Name='depth'", "Units='mm'", EINVAL, 15, "'Units'"},
		{"Name='force'", "NumRules=2", EINVAL, 29, "'NumRules'"},
		{"Version=2.0", "Type='sugeno'", EINVAL, 4, "Type is given twice"},
		{"Name='depth'", "Range=[0 1]", EINVAL, 16, "Range is given twice"},
		{"Name='force'", "Range=[0 1]", EINVAL, 30, "Range is given twice"},
		{"MF2='high'", "MF1='high'", EINVAL, 19, "MF1 is given twice"},
		{"MF2='strong'", "MF1='strong'", EINVAL, 33, "MF1 is given twice"},
		{"[Input2]", "[Input1]", EINVAL, 23, "Name is given twice"},
		{"Type='sugeno'\n", "", EINVAL, 34, "Type"},
		{"'sugeno'", " 'mamdani' % no", ENOTSUP, 3, "mamdani"},
		{"AndMethod='prod'", "AndMethod = 'max'", ENOTSUP, 8, "'max'"},
		{"Name='depth'", "Name='pig's'", EINVAL, 15, "end of the line"},
		{"Name='depth'", "Name='depth", EINVAL, 15, "no end"},
		{"1 1, 1 (1)", "1.5 1, 1 (1)", EINVAL, 36, "input 1"},
		{"1 1, 1 (1)", "1 1, 1.000 (1) 2", EINVAL, 36, "') : 1'"},
		{"Range=[0 30]", "Range=[3 2]", EINVAL, 30, "smaller"},
		{"Range=[-5 5]", "Range=[5 5]", EINVAL, 24, "smaller"},
	};

	static const struct changed kinds[] = {
		{"trimf',[0 0 4]", "trimf',[0 5 4]", EINVAL, 13, "low, a trimf: "},
		{"trimf',[0 0 4]", "trimf',[1 0 4]", EINVAL, 13, "must not fall"},
		{"trimf',[0 0 4]", "trimf',[0 0]", EINVAL, 13, "number 3"},
		{"trimf',[0 0 4]", "trimf',[0 0 4 5]", EINVAL, 13, "expected ']'"},
		{"trimf',[0 0 4]", "trimf',[-inf 0 4]", EINVAL, 13, "not finite"},
		{"trapmf',[2 4 6 8]", "trapmf',[2 4 6]", EINVAL, 14, "number 4"},
		{"trapmf',[2 4 6 8]", "trapmf',[2 4 6 5]", EINVAL, 14, "mid, a trapmf: "},
		{"trapmf',[2 4 6 8]", "trapmf',[2 4 1 2]", EINVAL, 14, "everywhere"},
		{"sigmf',[2 7]", "sigmf',[2 nan]", EINVAL, 15, "not finite"},
		{"sigmf',[2 7]", "dsigmf',[2 7 3 4]", ENOTSUP, 15, "'dsigmf'"},
		{"gauss2mf',[1 4 2 5]", "gauss2mf',[1 4 0 5]", EINVAL, 16,
		 "two, a gauss2mf"},
		{"gauss2mf',[1 4 2 5]", "gauss2mf',[1 4]", EINVAL, 16, "number 3"},
		{"gbellmf',[0.5 2 1]", "gbellmf',[0.5 0 1]", EINVAL, 22, "e, a gbellmf"},
		{"(0.25) : 1", "(0.25) : 2", ENOTSUP, 31, "'or'"},
		{"4 0, 2 (1) : 2", "0 0, 2 (1) : 2", ENOTSUP, 33, "'or'"},
		{"4 0, 2 (1) : 2", "-4 0, 2 (1) : 2", ENOTSUP, 33, "'not'"},
		{"4 0, 2 (1) : 2", "4 0, 2 (1) : 3", EINVAL, 33, ": 1"},
		{"1 1, 1 (1) : 1\n2 2, 2 (0.25) : 1\n3 0, 1 (0) : 1\n4 0, 2 (1)",
		 "1 1, 1 (0) : 1\n2 2, 2 (0) : 1\n3 0, 1 (0) : 1\n4 0, 2 (0)", EINVAL, 33,
		 "weight 0"},
	};
	size_t n = sizeof(cases) / sizeof(*cases),
	       n_kinds = sizeof(kinds) / sizeof(*kinds);

	for (size_t i = 0; i < n + n_kinds; i++) {
		const struct changed *c = i < n ? &cases[i] : &kinds[i - n];
		struct incise_error err;
		char where[40];

		snprintf(where, sizeof(where), ":%d: ", c->line);
		load_changed(i < n ? matlab : every_kind, c->from, c->to, &err);
		assert_int_equal(err.code, c->code);
		assert_says(err.text, where, c->word);
	}
}

/* Load the file of MATLAB with other words for the same, and return its output. */
static double eval_changed(const char *from, const char *to)
{
	const char *at = strstr(matlab, from);
	struct incise_error err = {0};
	struct incise_model *model;
	char text[2048];
	double y;

	assert_non_null(at);
	snprintf(text, sizeof(text), "%.*s%s%s", (int)(at - matlab), matlab, to,
		 at + strlen(from));
	put(text, strlen(text));
	model = incise_model_load(path, &err);
	if (!model)
		fail_msg("%s", err.text);
	y = incise_model_eval(model, (double[]){4, 1}, NULL);
	incise_model_free(model);
	return y;
}

/* Other programs' ways to write the same model. */
TEST(test_spellings_mean_the_same)
{
	static const char *const cases[][2] = {
		{"AndMethod='prod'", "  AndMethod \t=\t 'prod'  "},
		{"Range=[0 10]", "Range = [ 0, 10 ]"},
		{"MF1='low':'gaussmf',[2.5 0]", "MF1 = 'low' : 'gaussmf' , [2.5, 0]"},
		{"[System]", "\xef\xbb\xbf[System]"},
		{"[System]", "## Octave\n# writes\n[System]"},
		{"NumRules=3", "NumRules=3 % three"},
		{"Name='depth'", "Name='50 % # deep' # a comment"},
		{"Name='depth'", "Name='pig''s'"},
		{"1 1, 1 (1) : 1", "1.000 1.0, 1.000 (1.000) : 1 % first"},
		{"1 1, 1 (1) : 1", "1 1 , 1 ( 1 ) :1"},
		{"[2.5 0]", "[-2.5 0]"},
		{"[2.5 2 10]", "[-2.5 2 10]"},
		{"Range=[0 30]", "Range=[2 2]"},
		{"'constant',[3]", "'constant',3"},
		/* MATLAB once filled up to four numbers; fuzzylite says what is on */
		{"[2.5 2 10]", "[2.5 2 10 0]"},
		{"[2.5 0]", "[2.5 0 0 0]"},
		{"'constant',[3]", "'constant',[3 0 0 0]"},
		{"Name='depth'", "Enabled=1\nName='depth'"},
	};
	double want = eval_changed("[System]", "[System]");

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++)
		if (eval_changed(cases[i][0], cases[i][1]) != want)
			fail_msg("%s: another output", cases[i][1]);
	assert_true(eval_changed("AndMethod='prod'", "AndMethod = 'min'") != want);
}

/* Blanks, comments and empty lines wherever they may be change no bit of any model. */
TEST(test_any_spelling_is_the_same_model)
{
	static const char *const blanks[] = {"", " ", "\t", "  \t "};
	struct incise_model *model = calloc(1, sizeof(*model)), *back;
	uint64_t seed = cases_seed(9);
	char line[1000];

	for (int n = 0; n < cases_of(400, 40); n++) {
		char *text = NULL;
		size_t size;
		FILE *in, *out = open_memstream(&text, &size);

		any_model(model, &seed, 1 + any_below(&seed, 8), 1 + any_below(&seed, 20),
			  12);
		assert_int_equal(incise_model_save(model, path, NULL), 0);
		in = fopen(path, "r");
		if (any_below(&seed, 2))
			fputs("\xef\xbb\xbf", out);
		while (fgets(line, sizeof(line), in)) {
			bool key = strchr(line, '=');

			line[strcspn(line, "\n")] = 0;
			if (!any_below(&seed, 4))
				fputs("# MF1='x' % [Rules]\n \t\n", out);
			fputs(blanks[any_below(&seed, 4)], out);
			for (const char *c = line; *c; c++) {
				bool sign = strchr("=:,()", *c) && (key || *line != '[');

				if (sign)
					fputs(blanks[any_below(&seed, 4)], out);
				fputc(*c, out);
				if (sign)
					fputs(blanks[any_below(&seed, 4)], out);
			}
			fputs(blanks[any_below(&seed, 4)], out);
			fputs(any_below(&seed, 2) ? "% '= a comment\r\n" : "\n", out);
		}
		fclose(in);
		fclose(out);
		put(text, strlen(text));
		err = (struct incise_error){0};
		back = incise_model_load(path, &err);
		if (!back)
			fail_msg("%s\n%s", err.text, text);
		assert_same_inside(model, back);
		incise_model_free(back);
		free(text);
	}
	free(model);
}

/* An input that no rule uses may have no function. */
TEST(test_no_functions)
{
	static const char text[] =
		"[System]\nName='one'\nType='sugeno'\nNumInputs=2\nNumOutputs=1\n"
		"NumRules=1\n[Input1]\nRange=[0 1]\nNumMFs=0\n[Input2]\nRange=[0 1]\n"
		"NumMFs=1\nMF1='a':'gaussmf',[1 0]\n[Output1]\nNumMFs=1\n"
		"MF1='a':'linear',[2 3 4]\n[Rules]\n0 1, 1 (1) : 1\n";
	struct incise_model *model, *back;

	put(text, strlen(text));
	model = incise_model_load(path, NULL);
	assert_non_null(model);
	assert_true(incise_model_eval(model, (double[]){0.5, 1}, NULL) == 8);
	assert_int_equal(incise_model_save(model, path, NULL), 0);
	back = incise_model_load(path, NULL);
	assert_non_null(back);
	assert_same_inside(model, back);
	incise_model_free(model);
	incise_model_free(back);
}

TEST(test_missing_file)
{
	assert_error(incise_model_load("/nonexistent/m.fis", &err), ENOENT, &err,
		     "/nonexistent/m.fis");
}

/* Cut anywhere but before the last line's end, a file is refused. */
TEST(test_truncation)
{
	const char *const texts[] = {matlab, every_kind};

	for (int t = 0; t < 2; t++)
		for (size_t k = 0; k + 1 < strlen(texts[t]); k++) {
			put(texts[t], k);
			assert_null(incise_model_load(path, NULL));
		}
}

GROUP(set_up, tear_down);
