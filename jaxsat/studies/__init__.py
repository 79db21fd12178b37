"""Monte-Carlo studies: dispersions, designs, ensembles."""

from jaxsat.studies.ensemble import run_study as run_study
from jaxsat.studies.executors import Threads as Threads
from jaxsat.studies.recovery_summary import reason_words as reason_words
from jaxsat.studies.statistics import StopRule as StopRule
from jaxsat.studies.statistics import wilson as wilson
from jaxsat.studies.summary import summarise as summarise
