# SPDX-License-Identifier: GPL-2.0-or-later
# Messages for people in one place: tests assert what a text names, and record the whole of it; tests/messages
# has the wording.

messages := $(abspath $(O))/messages

golden: ## write tests/messages from what the unit tests print; CLI=yes: and the command-line tests
	@rm -rf $(messages); mkdir -p $(messages)
	+@INCISE_MESSAGES=$(messages)/unit $(MAKE) --no-print-directory check-unit
	@tests/golden -w unit $(messages)/unit
	$(if $(CLI),+@INCISE_MESSAGES=$(messages)/cli $(MAKE) --no-print-directory check-cli)
	$(if $(CLI),@tests/golden -w cli $(messages)/cli)

# After the tests have run, each part with INCISE_MESSAGES=$(messages)/PART; SOME=yes: not all of the tests of a file.
check-messages: $(addprefix check-messages-,unit cli)
check-messages-%:
	@tests/golden $* $(messages)/$*

.PHONY: golden check-messages
