"""What is told of the progress of a study."""

from jaxsat.cli.listening import progress_text
from jaxsat.studies.run import StudyProgress


def test_progress_never_says_that_no_time_is_left():
    """An estimate below half a second would read "0 s left" until the last chunk is done."""
    text = progress_text(StudyProgress(done=9_999, count=10_000, settled=9_999, rate=5.0))
    assert "finishing" in text
    assert "0 s left" not in text
    assert "9 s left" in progress_text(StudyProgress(done=1, count=10, settled=1, rate=1.0))
