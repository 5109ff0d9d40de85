// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise compile MODEL.fis -o MODEL.fx: a model in integers, with a certified bound of
 * its error.
 */
#include <ctype.h>
#include <getopt.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/fixed.h>
#include <incise/model.h>
#include "cli/cli.h"
#include "cli/json.h"

enum { OPT_BUDGET = CLI_LONG, OPT_ARITH, OPT_CELLS, OPT_C_SOURCE, OPT_JSON };

static const struct cli_option options[] = {
	{'o', "output", "FILE",
	 "write the compiled model there (.fx); '-' is standard output"},
	{OPT_BUDGET, "budget", "ERROR",
	 "largest error that may be certified, e.g. 0.1mN, 50uN or\n"
	 "1e-4 in the output's unit (default: 0.1mN)"},
	{OPT_ARITH, "arith", "KIND",
	 "direct, table or force (default: the cheapest within the\n"
	 "budget)"},
	{OPT_CELLS, "cells", "N", "at least N cells per input of tables, up to 4096"},
	{OPT_C_SOURCE, "c-source", "FILE.c",
	 "write it as C for a microcontroller, too; FILE_eval() is the\n"
	 "function"},
	{OPT_JSON, "json", NULL, "report as JSON"},
	{0},
};

static const struct cli_command command = {
	.name = "compile",
	.synopsis = "MODEL.fis -o MODEL.fx [OPTIONS]",
	.summary =
		"Compile a model to integers, for the haptic loop and for kernels. The largest\n"
		"error over the whole support is certified by interval arithmetic.",
	.options = options,
	.notes = "Example:\n  incise compile liver.fis --budget 0.1mN -o liver.fx\n\n"
		 "Exit: 0 compiled, 1 failed, 2 bad usage. See incise-compile(1).",
};

static double parse_budget(const char *text)
{
	static const struct {
		const char *unit;
		double scale;
	} units[] = {{"", 1}, {"N", 1}, {"mN", 1e-3}, {"uN", 1e-6}, {"µN", 1e-6}};
	char *end;
	double value = strtod(text, &end);

	for (size_t i = 0; i < sizeof(units) / sizeof(*units) && end != text; i++) {
		if (strcmp(end, units[i].unit))
			continue;
		value *= units[i].scale;
		if (!(value >= 1e-9 && value <= 1e9))
			cli_usage("--budget: %s is not within 1e-9 to 1e9", text);
		return value;
	}
	cli_usage("--budget: '%s' is not an error such as 0.1mN, 50uN or 1e-4", text);
}

static int parse_arithmetic(const char *text)
{
	for (int a = INCISE_FIXED_DIRECT; a <= INCISE_FIXED_FORCE; a++)
		if (!strcmp(text, incise_fixed_arithmetic_name(a)))
			return a;
	cli_usage("--arith: '%s' is none of direct, table and force", text);
}

/* "out/pig liver.c" makes pig_liver: a C name of the file's own. */
static char *symbol_of(const char *path)
{
	const char *slash = strrchr(path, '/'), *name = slash ? slash + 1 : path;
	char *symbol = strndup(name, strcspn(name, "."));

	if (!symbol)
		cli_fail("no memory");
	for (char *c = symbol; *c; c++)
		if (!isalnum((unsigned char)*c) || (unsigned char)*c >= 0x80)
			*c = '_';
	if (!*symbol || isdigit((unsigned char)*symbol))
		cli_usage("--c-source: '%s' gives no name in C: begin it with a letter",
			  path);
	return symbol;
}

static void write_c(const struct incise_fixed *fx, const char *path)
{
	struct incise_error err = {0};
	char *symbol = symbol_of(path);

	if (incise_fixed_write_c(fx, path, symbol, &err))
		cli_fail_with(&err);
	free(symbol);
}

static void report(const struct incise_fixed *fx, const char *model, const char *path,
		   bool json)
{
	const char *name = incise_fixed_arithmetic_name(fx->arithmetic);
	json_t *cells = json_array();

	for (int i = 0; i < fx->n_inputs; i++)
		json_array_append_new(cells, json_integer(fx->input[i].cells));
	if (json) {
		json_print(json_pack("{so so ss so si sf}", "model", json_text(model),
				     "output", json_text(path), "arithmetic", name,
				     "cells", cells, "size_bytes", fx->size, "bound_N",
				     incise_fixed_bound(fx)));
		return;
	}
	json_decref(cells);
	if (!strcmp(path, "-"))
		return;
	printf("%s: %s", model, name);
	for (int i = 0; i < fx->n_inputs && fx->input[i].cells; i++)
		printf(i ? " x %d" : ", %d", fx->input[i].cells);
	printf("%s, %u bytes; error certified to %.3g mN\nwrote %s\n",
	       fx->input[0].cells ? " cells" : "", fx->size, incise_fixed_bound(fx) * 1e3,
	       path);
}

int main(int argc, char **argv)
{
	struct incise_fixed_options o;
	struct incise_error err = {0};
	struct incise_fixed *fx;
	struct incise_model *model;
	const char *output = NULL, *c_source = NULL;
	bool json = false;
	int opt;

	incise_fixed_options_init(&o);
	while ((opt = cli_next(&command, argc, argv)) != CLI_END)
		switch (opt) {
		case 'o':
			output = optarg;
			break;
		case OPT_BUDGET:
			o.budget = parse_budget(optarg);
			break;
		case OPT_ARITH:
			o.arithmetic = parse_arithmetic(optarg);
			break;
		case OPT_CELLS:
			o.cells = cli_integer("cells", optarg, 1, 4096);
			break;
		case OPT_C_SOURCE:
			c_source = optarg;
			free(symbol_of(c_source));
			break;
		case OPT_JSON:
			json = true;
			break;
		}
	if (optind + 1 != argc)
		cli_usage("expected one model, got %d", argc - optind);
	if (!output || !*output)
		cli_usage("where should the compiled model go? Give -o MODEL.fx");
	if (json && !strcmp(output, "-"))
		cli_usage("--json and -o - would both write to standard output");
	model = incise_model_load(argv[optind], &err);
	if (!model)
		cli_fail_with(&err);
	fx = incise_fixed_compile(model, &o, &err);
	if (!fx)
		cli_fail("%s: %s", argv[optind], err.text);
	if (incise_fixed_save(fx, output, &err))
		cli_fail_with(&err);
	if (c_source)
		write_c(fx, c_source);
	report(fx, argv[optind], output, json);
	cli_finish();
	incise_fixed_free(fx);
	incise_model_free(model);
	return 0;
}
