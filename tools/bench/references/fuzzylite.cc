// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * fuzzylite as a reference implementation for incise bench. The model is handed over by fuzzylite's own
 * interface, in double: its .fis files hold three decimals.
 */
#include <cstdio>
#include <exception>
#include <memory>
#include <string>
#include <vector>
#include <fl/Headers.h>
#include "../reference.h"

namespace
{

struct engine {
	fl::Engine engine;
	std::vector<fl::InputVariable *> inputs;
	fl::OutputVariable *output;
};

std::string name(const char *kind, int i, int k = 0)
{
	return kind + std::to_string(i + 1) + "_" + std::to_string(k + 1);
}

void add_inputs(engine &e, const incise_model *model)
{
	for (int i = 0; i < incise_model_info(model)->n_inputs; i++) {
		const incise_variable *v = &incise_model_info(model)->input[i];
		auto input = new fl::InputVariable(name("x", i), v->min, v->max);

		e.engine.addInputVariable(input);
		e.inputs.push_back(input);
		for (int k = 0; k < incise_model_info(model)->n_mfs[i]; k++) {
			const incise_mf *mf = incise_model_mf(model, i, k);

			if (mf->type != INCISE_MF_GAUSS)
				throw fl::Exception(std::string("a ") +
						    incise_mf_type_name(mf->type) +
						    " is not handed over");
			input->addTerm(new fl::Gaussian(name("mf", i, k), mf->p[1], mf->p[0]));
		}
	}
}

void add_rules(engine &e, const incise_model *model)
{
	const incise_variable *v = &incise_model_info(model)->output;
	int n = incise_model_info(model)->n_inputs;
	auto block = new fl::RuleBlock("rules");

	e.output = new fl::OutputVariable("y", v->min, v->max);
	e.engine.addOutputVariable(e.output);
	e.output->setDefuzzifier(new fl::WeightedAverage(fl::WeightedDefuzzifier::TakagiSugeno));
	e.output->setAggregation(nullptr);
	e.engine.addRuleBlock(block);
	block->setConjunction(new fl::AlgebraicProduct);
	block->setImplication(new fl::AlgebraicProduct);
	block->setActivation(new fl::General);
	for (int r = 0; r < incise_model_info(model)->n_rules; r++) {
		const double *p = incise_model_rule(model, r)->p;
		/* The constant comes last. */
		std::vector<fl::scalar> coefficients(p + 1, p + n + 1);
		std::string text = "if ";

		coefficients.push_back(p[0]);
		e.output->addTerm(new fl::Linear(name("rule", r), coefficients, &e.engine));
		for (int i = 0; i < n; i++)
			text += (i ? " and " : "") + name("x", i) + " is " +
				name("mf", i, incise_model_rule(model, r)->mf[i]);
		text += " then y is " + name("rule", r);
		block->addRule(fl::Rule::parse(text, &e.engine));
	}
}

void *open(const incise_model *model, char *why, std::size_t size)
{
	try {
		std::unique_ptr<engine> e(new engine);
		std::string status;

		fl::fuzzylite::setLogging(false);
		add_inputs(*e, model);
		add_rules(*e, model);
		if (!e->engine.isReady(&status))
			throw fl::Exception(status);
		return e.release();
	} catch (const std::exception &x) {
		std::snprintf(why, size, "%s", x.what());
		return nullptr;
	}
}

void run(void *handle, const double *x, double *y, std::size_t n)
{
	auto e = static_cast<engine *>(handle);

	for (std::size_t k = 0; k < n; k++) {
		for (auto input : e->inputs)
			input->setValue(*x++);
		e->engine.process();
		y[k] = e->output->getValue();
	}
}

const std::string version = fl::fuzzylite::version();

} /* namespace */

const struct reference incise_reference = {version.c_str(), open, run};
