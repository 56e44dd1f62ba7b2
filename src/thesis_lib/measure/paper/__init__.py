"""What is needed on paper: boards, markers and where cameras stand, as PDF to true scale."""
